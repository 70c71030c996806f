// The page's language: English stands in the code, fr.json has the others' texts by what they are in English.

const CHOSEN = "elys.language";
let texts = {};

export let language = "en";

/** `text` in the chosen language, with `{name}` places filled from `values`. */
export function tr(text, values = {}) {
  return (texts[text] ?? text).replace(/\{(\w+)\}/g, (place, name) => values[name] ?? place);
}

/** A field's or component's name as people read it: linear_velocity is "Linear velocity". */
export function label(name) {
  const words = name.replaceAll("_", " ");
  return tr(words.charAt(0).toUpperCase() + words.slice(1));
}

/** Speaks the language that was chosen here before, else the first of the browser's that is known. */
export async function startLanguage() {
  const kept = read(CHOSEN);
  await speak(kept ?? (navigator.languages.find((code) => /^(en|fr)\b/.test(code)) ?? "en").slice(0, 2));
  const choice = document.getElementById("language");
  choice.value = language;
  choice.addEventListener("change", async () => {
    try {
      localStorage.setItem(CHOSEN, choice.value);
    } catch { /* a browser that keeps nothing: the choice holds until the page is closed */ }
    await speak(choice.value);
    document.dispatchEvent(new Event("languagechange"));
  });
}

async function speak(code) {
  language = code === "fr" ? "fr" : "en";
  texts = language === "fr" ? await (await fetch("page/fr.json")).json() : {};
  document.documentElement.lang = language;
  for (const [attribute, put] of PLACES)
    for (const element of document.querySelectorAll(`[${attribute}]`)) put(element, tr(element.getAttribute(attribute)));
}

const PLACES = [
  ["data-tr", (element, text) => (element.textContent = text)],
  ["data-tr-label", (element, text) => element.setAttribute("aria-label", text)],
  ["data-tr-placeholder", (element, text) => element.setAttribute("placeholder", text)],
  ["data-tr-title", (element, text) => {
    element.title = text;
    if (element.matches("button, select") && !element.textContent.trim()) element.setAttribute("aria-label", text);
    if (element.matches("select")) element.setAttribute("aria-label", text);
  }],
];

function read(name) {
  try {
    return localStorage.getItem(name);
  } catch {
    return null;
  }
}
