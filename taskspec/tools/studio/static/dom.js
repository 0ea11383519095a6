// Elements of the page.

/** Make an element; attributes that begin with "on" are listeners, and those that are null or false are left out. */
export function make(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value !== null && value !== false) made.setAttribute(name, value === true ? "" : value);
  }
  made.append(...children);
  return made;
}

/** Return the element with an id. */
export function byId(id) {
  return document.getElementById(id);
}

/** Make an element of HTML that the server has written and escaped. */
export function written(tag, attributes, html) {
  const made = make(tag, attributes);
  made.innerHTML = html;
  return made;
}

/** Make words in the colour of what matters less. */
export function quiet(...words) {
  return make("p", { class: "quiet" }, ...words);
}

/** Make a control with its name. */
export function labelled(name, control) {
  return make("label", {}, make("span", {}, name), control);
}

/** Make a choice of one of several, each a value with its words. */
export function choice(options, value, changed) {
  const made = make("select", { onchange: () => changed(made.value) });
  made.append(...options.map(([key, words]) => make("option", { value: key, selected: key === value }, words)));
  return made;
}

/** Make a table of rows of cells, of which the first is a title; it scrolls by itself. */
export function table(label, titles, rows) {
  const head = make("tr", {}, ...titles.map((title) => make("th", { scope: "col" }, title)));
  const body = rows.map(([first, ...cells]) =>
    make("tr", {}, make("th", { scope: "row" }, first), ...cells.map((cell) => make("td", {}, cell))),
  );
  const whole = make("table", {}, make("thead", {}, head), make("tbody", {}, ...body));
  return make("div", { class: "wide", tabindex: 0, role: "region", "aria-label": label }, whole);
}

/** Return a figure with its caption as a list; an empty one where nothing is drawn. */
export function picture(svg, caption = "") {
  if (!svg) return [];
  const figure = written("figure", { class: "picture" }, svg);
  if (caption) figure.append(make("figcaption", {}, caption));
  return [figure];
}

/** Return a number with at most five significant digits. */
export function short(number) {
  return number === null ? "–" : String(Number(number.toPrecision(5))).replace("-", "−");
}

/** Return a result to three significant digits, or to a whole number; the exact one is its tooltip. */
export function rounded(number) {
  if (number === null) return "–";
  const kept = Math.abs(number) < 100 ? Number(number.toPrecision(3)) : Math.round(number);
  const [text, exact] = [kept, number].map((each) => String(each).replace("-", "−"));
  return text === exact ? text : make("span", { title: exact }, text);
}

/** Milliseconds after which what is no longer true is greyed, and an empty part says that it is being worked out. */
const LATE = 150;

/** A part of the page that follows answers: what it shows stays, greyed, until the next answer is there. */
export class Part {
  constructor(label, attributes = {}) {
    this.content = make("div");
    this.problem = make("p", { class: "problem", role: "status" });
    this.element = make("section", { "aria-label": label, ...attributes }, this.problem, this.content);
  }

  /** Show what `draw` makes of an answer, or say why there is none. Mistakes in the text are shown by the editor. */
  async follow(asked, draw) {
    this.element.setAttribute("aria-busy", "true");
    this.late ??= setTimeout(() => this.element.classList.add(this.content.hasChildNodes() ? "old" : "empty"), LATE);
    const answer = await asked;
    if (answer.outdated) return;
    this.element.removeAttribute("aria-busy");
    const isInText = answer.problems?.some(({ line }) => line !== null);
    this.problem.textContent = answer.ok || isInText ? "" : [answer.message, answer.hint].filter(Boolean).join("; ");
    if (!answer.ok) return;
    clearTimeout(this.late);
    this.late = null;
    this.element.classList.remove("old", "empty");
    this.content.replaceChildren(...draw(answer));
  }
}
