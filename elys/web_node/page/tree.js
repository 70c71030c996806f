// The tree of entities: only lines that are in sight are asked for and drawn, however many there are.

import { tr } from "./language.js";

const HEIGHT = 26; // [pixels] of a line
const INDENT = 14;
const AHEAD = 12; // lines asked for beyond each edge of what is in sight
const MOST = 200; // lines at once

export class Tree extends EventTarget {
  #link;
  #box = document.getElementById("tree");
  #content = document.getElementById("tree-lines");
  #search = document.getElementById("search");
  #note = document.getElementById("search-note");
  #told = { first: 0, total: 0, lines: [] };
  #asked = "";
  #selected = 0;
  #here = 0; // the entity of the line at which the keyboard stands
  #searching = 0;
  #going = -1; // the line that the keyboard is on its way to

  constructor(link) {
    super();
    this.#link = link;
    link.addEventListener("rows", ({ detail }) => this.#take(detail));
    link.addEventListener("open", () => this.#ask({ anew: true }));
    this.#box.addEventListener("scroll", () => this.#ask());
    new ResizeObserver(() => this.#ask()).observe(this.#box);
    this.#box.addEventListener("click", (event) => this.#clicked(event));
    this.#box.addEventListener("keydown", (event) => this.#key(event));
    this.#search.addEventListener("input", () => {
      clearTimeout(this.#searching);
      this.#searching = setTimeout(() => {
        this.#box.scrollTop = 0;
        this.#ask({ anew: true });
      }, 120);
    });
    document.addEventListener("languagechange", () => this.#draw());
  }

  /** Marks an entity as chosen; `reveal` opens all above it and scrolls to it. */
  select(entity, { reveal = false } = {}) {
    this.#selected = this.#here = entity;
    if (reveal && entity) this.#link.send({ type: "reveal", entity });
    this.#draw();
  }

  #ask({ anew = false } = {}) {
    const rows = Math.ceil(this.#box.clientHeight / HEIGHT);
    const first = Math.max(Math.floor(this.#box.scrollTop / HEIGHT) - AHEAD, 0);
    const count = Math.min(rows + 2 * AHEAD, MOST);
    const wanted = JSON.stringify([first, count, this.#search.value]);
    if (wanted === this.#asked && !anew) return;
    if (this.#link.send({ type: "rows", first, count, search: this.#search.value.slice(0, 200) })) this.#asked = wanted;
  }

  #take(told) {
    this.#told = told;
    this.#content.style.height = `${told.total * HEIGHT}px`;
    document.getElementById("entity-count").textContent = told.entities.toLocaleString();
    this.#tellSearch(told);
    if (told.revealed) this.#scrollTo(told.revealed.place);
    this.#draw();
    if (this.#going >= 0) this.#goTo(Math.min(this.#going, told.total - 1));
    this.#ask();
  }

  #tellSearch({ wrong, found, search }) {
    this.#note.hidden = !wrong && !search;
    this.#note.classList.toggle("wrong", Boolean(wrong));
    if (wrong) this.#note.textContent = tr(wrong.problem, wrong.values);
    else if (search) this.#note.textContent = tr("{count} found", { count: (found ?? 0).toLocaleString() });
  }

  #scrollTo(place) {
    const [top, height] = [place * HEIGHT, this.#box.clientHeight];
    if (top < this.#box.scrollTop) this.#box.scrollTop = top;
    else if (top + HEIGHT > this.#box.scrollTop + height) this.#box.scrollTop = top + HEIGHT - height;
  }

  /** Lines keep their elements as long as they are in sight, so that a click finds under the pointer what was there. */
  #draw() {
    const inSight = new Set(this.#told.lines.map((line) => `line-${line.id}`));
    for (const element of [...this.#content.children]) if (!inSight.has(element.id)) element.remove();
    this.#told.lines.forEach((line, index) => {
      const id = `line-${line.id}`;
      const element = document.getElementById(id) ?? this.#make(id, line.id);
      const there = this.#content.children[index] ?? null; // in the order in which they are read
      if (there !== element) this.#content.insertBefore(element, there);
      this.#fill(element, line, this.#told.first + index);
    });
    const here = document.getElementById(`line-${this.#here}`);
    here ? this.#box.setAttribute("aria-activedescendant", here.id) : this.#box.removeAttribute("aria-activedescendant");
  }

  #make(id, entity) {
    const element = document.createElement("div");
    element.id = id;
    element.className = "line";
    element.role = "treeitem";
    element.dataset.entity = entity;
    element.append(span("arrow"), span("name"), span("kind"));
    return element;
  }

  #fill(element, line, place) {
    const [arrow, name, kind] = element.children;
    element.style.top = `${place * HEIGHT}px`;
    element.style.paddingLeft = `${6 + line.depth * INDENT}px`;
    element.classList.toggle("off", !line.on);
    element.classList.toggle("dim", line.dim);
    element.ariaLevel = line.depth + 1;
    element.ariaPosInSet = place + 1;
    element.ariaSetSize = this.#told.total;
    element.ariaSelected = line.id === this.#selected;
    line.open ? (element.ariaExpanded = line.open === 2) : element.removeAttribute("aria-expanded");
    if (Boolean(arrow.firstChild) !== Boolean(line.open)) arrow.innerHTML = line.open ? '<svg aria-hidden="true"><use href="#i-open"/></svg>' : "";
    name.textContent = line.name || `#${line.id}`;
    kind.textContent = line.kind; // in every language, for it is what one searches by: t:Light
    kind.setAttribute("aria-hidden", "true");
  }

  #clicked(event) {
    const element = event.target.closest(".line");
    if (!element) return;
    const entity = Number(element.dataset.entity);
    const line = this.#told.lines.find((one) => one.id === entity);
    if (line?.open && event.target.closest(".arrow")) this.#open(line, line.open === 1, event.altKey);
    else this.#choose(entity);
  }

  #open(line, isOpen, allBelow = false) {
    this.#link.send({ type: "open", entity: line.id, is_open: isOpen, all_below: allBelow });
  }

  #choose(entity) {
    this.select(entity);
    this.dispatchEvent(new CustomEvent("choose", { detail: entity }));
  }

  #key(event) {
    const { first, lines, total } = this.#told;
    const index = lines.findIndex((line) => line.id === this.#here);
    const line = lines[index];
    const page = Math.max(Math.floor(this.#box.clientHeight / HEIGHT) - 1, 1);
    const go = (place) => this.#goTo(Math.min(Math.max(place, 0), total - 1));
    const keys = {
      ArrowDown: () => go(index < 0 ? first : first + index + 1),
      ArrowUp: () => go(index < 0 ? first : first + index - 1),
      PageDown: () => go(first + Math.max(index, 0) + page),
      PageUp: () => go(first + Math.max(index, 0) - page),
      Home: () => go(0),
      End: () => go(total - 1),
      ArrowRight: () => line?.open === 1 ? this.#open(line, true, event.altKey) : line?.open === 2 && go(first + index + 1),
      ArrowLeft: () => line?.open === 2 ? this.#open(line, false, event.altKey) : this.#goOut(index),
    };
    if (!keys[event.key] || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    keys[event.key]();
  }

  /** To a line; to one that has not been told yet when it has been. */
  #goTo(place) {
    this.#scrollTo(place);
    const line = this.#told.lines[place - this.#told.first];
    this.#going = line ? -1 : place;
    line ? this.#choose(line.id) : this.#ask();
  }

  #goOut(index) {
    const { first, lines } = this.#told;
    for (let above = index - 1; above >= 0; above--)
      if (lines[above].depth < lines[index].depth) return this.#goTo(first + above);
  }
}

function span(name) {
  const element = document.createElement("span");
  element.className = name;
  return element;
}
