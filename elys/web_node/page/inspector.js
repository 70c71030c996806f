// What is chosen: its name, its switch, its components. Edits are commands; what is seen is what the session says.

import { explanation, makeField } from "./fields.js";
import { label, tr } from "./language.js";

export class Inspector {
  #link;
  #box = document.getElementById("inspector");
  #refusal = document.getElementById("refusal");
  #declared = new Map();
  #told = null;
  #made = null; // what the widgets were made for
  #head = null;
  #fields = new Map(); // "Component.field": widget
  mayEdit = false;
  entity = 0;

  constructor(link) {
    this.#link = link;
    link.addEventListener("welcome", ({ detail }) => {
      this.#declared = new Map(detail.components.map((component) => [component.name, component]));
      this.inspect(this.entity);
    });
    link.addEventListener("entity", ({ detail }) => detail.entity === this.entity && this.#take(detail));
    document.addEventListener("languagechange", () => this.#draw({ anew: true }));
  }

  /** Shows an entity; 0 for none. */
  inspect(entity) {
    if (entity !== this.entity) this.#refusal.hidden = true;
    this.entity = entity;
    this.#link.send({ type: "inspect", entity });
    if (!entity) this.#take(null);
  }

  /** What may be done here has changed. */
  allow(mayEdit) {
    if (mayEdit === this.mayEdit) return;
    this.mayEdit = mayEdit;
    this.#draw({ anew: true });
  }

  /** Asks the session for an edit; a refusal is told below the fields. */
  async edit(command, text) {
    const made_from = this.#told?.revision ?? -1;
    const answer = await this.#link.ask({ type: "ask", command, label: text, made_from });
    this.#refusal.hidden = answer.accepted;
    if (!answer.accepted) {
      this.#refusal.textContent = answer.problem ? tr(answer.problem, translated(answer.values)) : tr(answer.reason);
      this.#draw({ anew: true }); // the widgets show again what holds
    }
    return answer;
  }

  #take(told) {
    this.#told = told;
    this.#draw();
  }

  #draw({ anew = false } = {}) {
    const told = this.#told;
    if (!told?.lives) {
      const text = told?.entity ? tr("It is not there any more.") : tr("Click on something in the view or in the tree.");
      this.#made = null;
      this.#box.replaceChildren(paragraph("empty", text));
      return;
    }
    const made = `${told.entity} ${Object.keys(told.components).join(" ")}`;
    if (anew || made !== this.#made) this.#make(told);
    this.#made = made;
    this.#head.show(told);
    for (const [path, widget] of this.#fields) {
      const [component, field] = path.split(".");
      widget.show(told.components[component][field], told.names);
    }
  }

  #make(told) {
    this.#fields.clear();
    this.#head = this.#makeHead();
    const open = new Set([...this.#box.querySelectorAll("details:not([open])")].map((box) => box.dataset.component));
    const components = Object.keys(told.components).map((name) => this.#makeComponent(name, told, !open.has(name)));
    this.#box.replaceChildren(this.#head.element, ...components);
  }

  #makeHead() {
    const element = document.createElement("div");
    element.className = "entity-head";
    const [on, name] = [document.createElement("input"), document.createElement("input")];
    on.type = "checkbox";
    name.type = "text";
    on.id = "entity-enabled";
    name.id = "entity-name";
    on.title = tr("Switched on");
    on.setAttribute("aria-label", tr("Switched on"));
    name.setAttribute("aria-label", tr("Name"));
    on.disabled = name.disabled = !this.mayEdit;
    on.addEventListener("change", () => this.edit({ type: "set_enabled", entity: this.entity, enabled: on.checked }, on.checked ? "Switch on" : "Switch off"));
    name.addEventListener("change", () => this.edit({ type: "rename", entity: this.entity, name: name.value }, "Rename"));
    element.append(on, name);
    return {
      element,
      show(told) {
        on.checked = told.enabled;
        if (name !== document.activeElement) name.value = told.name;
        name.title = told.prefab;
      },
    };
  }

  #makeComponent(name, told, isOpen) {
    const declared = this.#declared.get(name);
    const element = document.createElement("details");
    element.className = "component";
    element.dataset.component = name;
    element.open = isOpen;
    const summary = document.createElement("summary");
    summary.textContent = name;
    summary.title = tr(declared.text);
    const fields = document.createElement("div");
    fields.className = "fields";
    for (const field of declared.fields) {
      const change = (value) => {
        const command = { type: "set_component", entity: this.entity, component: name, values: { [field.name]: value } };
        this.edit(command, `Set ${name} ${field.name.replaceAll("_", " ")}`);
      };
      const widget = makeField(name, field, { mayEdit: this.mayEdit, change });
      const title = document.createElement("label");
      title.htmlFor = widget.id;
      title.textContent = label(field.name);
      title.title = explanation(field);
      fields.append(title, widget.element);
      this.#fields.set(`${name}.${field.name}`, widget);
    }
    element.append(summary, fields);
    return element;
  }
}

/** Values of a refusal, such as names of roles, in the page's language. */
export function translated(values) {
  return Object.fromEntries(Object.entries(values).map(([name, value]) => [name, tr(value)]));
}

function paragraph(name, text) {
  const element = document.createElement("p");
  element.className = name;
  element.textContent = text;
  return element;
}
