// One widget for each kind of field, made from its declaration alone.

import { tr, label } from "./language.js";
import { degreesOf, quaternionOf } from "./orbit.js";

const AXES = ["x", "y", "z"];

/** A widget: `element`, `show(value, names)`, and `name`, the id of what a label is for. `change(value)` hears of edits. */
export function makeField(component, field, { mayEdit, change }) {
  const id = `field-${component}-${field.name}`;
  const make = { bool: makeSwitch, choice: makeChoice, color: makeColor, text: makeText, asset: makeText, entity: makeEntity }[field.kind];
  const made = (make ?? makeNumbers)(field, id, change);
  made.element.classList.add("value");
  for (const widget of made.element.querySelectorAll("input, select")) {
    widget.disabled = !mayEdit;
    if (widget.id !== id) widget.setAttribute("aria-label", `${label(field.name)} ${widget.dataset.axis ?? ""}`.trim());
  }
  return { ...made, id };
}

/** A field's explanation: what it is, in which unit, between which limits. */
export function explanation(field) {
  const limits = [
    field.minimum !== null && tr("at least {least}", { least: shown(field.minimum) }),
    field.maximum !== null && tr("at most {most}", { most: shown(field.maximum) }),
  ].filter(Boolean);
  return [tr(field.text), limits.join(", ")].filter(Boolean).join("\n");
}

function makeNumbers(field, id, change) {
  const isRotation = field.kind === "quat";
  const count = { vec3: 3, quat: 3 }[field.kind] ?? 1;
  const inputs = Array.from({ length: count }, (_, index) => {
    const input = textInput(index ? `${id}-${index}` : id);
    input.inputMode = "decimal";
    if (count > 1) {
      input.classList.add("axis", AXES[index]);
      input.dataset.axis = AXES[index];
    }
    return input;
  });
  let before = [];
  const commit = (index) => {
    const typed = Number(inputs[index].value.trim().replace(",", "."));
    const isWrong = !inputs[index].value.trim() || !Number.isFinite(typed) || (field.kind === "int" && !Number.isInteger(typed));
    inputs[index].classList.toggle("wrong", isWrong);
    inputs[index].setAttribute("aria-invalid", isWrong);
    if (isWrong || typed === before[index]) return;
    const values = before.map((value, place) => (place === index ? typed : value));
    change(isRotation ? quaternionOf(values) : count === 1 ? values[0] : values);
  };
  inputs.forEach((input, index) => {
    input.addEventListener("change", () => commit(index));
    input.addEventListener("keydown", (event) => step(event, input, isRotation ? 1 : field.step));
  });
  const element = row(...inputs);
  if (isRotation || field.unit) element.append(unit(isRotation ? "°" : field.unit));
  return {
    element,
    show(value) {
      before = isRotation ? degreesOf(value) : [value].flat();
      inputs.forEach((input, index) => {
        if (input === document.activeElement && input.classList.contains("typed")) return;
        input.value = shown(before[index], count > 1 ? 4 : 6); // three share the line
        input.title = String(before[index]);
        input.classList.remove("wrong");
      });
    },
  };
}

/** Arrows change a number by the field's step; Escape takes back what was typed. */
function step(event, input, size) {
  const direction = { ArrowUp: 1, ArrowDown: -1 }[event.key];
  if (direction) {
    event.preventDefault();
    input.value = shown(Number(input.value) + direction * size * (event.shiftKey ? 10 : 1));
    input.dispatchEvent(new Event("change"));
  } else if (event.key === "Enter" || event.key === "Escape") {
    input.classList.remove("typed");
  }
}

function makeSwitch(field, id, change) {
  const input = document.createElement("input");
  input.type = "checkbox";
  input.id = id;
  input.addEventListener("change", () => change(input.checked));
  return { element: row(input), show: (value) => (input.checked = value) };
}

function makeChoice(field, id, change) {
  const select = document.createElement("select");
  select.id = id;
  select.append(...field.choices.map((choice) => new Option(choice, choice)));
  select.addEventListener("change", () => change(select.value));
  return { element: row(select), show: (value) => (select.value = value) };
}

function makeText(field, id, change) {
  const input = textInput(id);
  input.addEventListener("change", () => change(input.value));
  return {
    element: row(input),
    show(value) {
      if (input !== document.activeElement) input.value = input.title = value;
    },
  };
}

/** Another entity: its name; chosen in the editor. */
function makeEntity(field, id, change) {
  const input = textInput(id);
  input.readOnly = true;
  return { element: row(input), show: (value, names) => (input.value = value ? names[value] ?? `#${value}` : "—") };
}

function makeColor(field, id, change) {
  const picker = document.createElement("input");
  picker.type = "color";
  const numbers = makeNumbers({ ...field, kind: "vec3" }, id, change);
  picker.addEventListener("change", () => change(linearOf(picker.value)));
  numbers.element.prepend(picker);
  return {
    element: numbers.element,
    show(value) {
      numbers.show(value);
      picker.value = codeOf(value);
    },
  };
}

function textInput(id) {
  const input = document.createElement("input");
  input.type = "text";
  input.id = id;
  input.autocomplete = "off";
  input.spellcheck = false;
  input.addEventListener("input", () => input.classList.add("typed"));
  input.addEventListener("blur", () => input.classList.remove("typed"));
  return input;
}

function row(...children) {
  const element = document.createElement("div");
  element.append(...children);
  return element;
}

function unit(text) {
  const element = document.createElement("span");
  element.className = "unit";
  element.textContent = text;
  return element;
}

/** A number as people read it, without the dirt of rounding. */
export function shown(value, digits = 6) {
  return value === undefined ? "" : String(Number(Number(value).toPrecision(digits)));
}

const encoded = (linear) => (linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055);
const decoded = (value) => (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4);

/** Linear RGB as #rrggbb in sRGB (IEC 61966-2-1), as far as that can say it. */
function codeOf(linear) {
  const bytes = linear.map((part) => Math.round(255 * Math.min(Math.max(encoded(part), 0), 1)));
  return "#" + bytes.map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

function linearOf(code) {
  return [1, 3, 5].map((at) => Number(decoded(parseInt(code.slice(at, at + 2), 16) / 255).toPrecision(6)));
}
