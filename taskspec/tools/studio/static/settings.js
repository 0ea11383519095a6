// The variant and the parameters of the task, as controls.

import { choice, labelled, make, short } from "./dom.js";

/** Return where the slider of a parameter begins and ends: within its bounds, and not far from its default. */
function reach({ kind, low, high, default: usual }) {
  const far = kind === "int" ? Math.max(10, 3 * Math.abs(usual)) : Math.max(1, 2 * Math.abs(usual));
  return [Math.max(low ?? -Infinity, usual - far), Math.min(high ?? Infinity, usual + far)];
}

export class Settings {
  /** Show controls in an element; `changed` is called when one of them was changed. */
  constructor(element, changed) {
    this.element = element;
    this.changed = changed;
    this.reset = make("button", { type: "button", onclick: () => this.use(null) }, "Reset");
    this.choose(null);
  }

  /** Replace the settings; their controls follow with the next description of the task. */
  choose(chosen) {
    this.chosen = { variant: chosen?.variant ?? null, parameters: { ...chosen?.parameters } };
    this.shown = "";
  }

  /** Replace the settings, and let everything follow. */
  use(chosen) {
    this.choose(chosen);
    this.changed();
  }

  /** Give one parameter the value of its control. */
  set(name, value) {
    this.chosen.parameters[name] = value;
    this.reset.hidden = false;
    this.changed();
  }

  /** Show the controls of a task; while the parameters are the same, so are their controls: a slider can be dragged on. */
  show({ variants, parameters }) {
    const names = parameters.map(({ name }) => name);
    const known = Object.entries(this.chosen.parameters).filter(([name]) => names.includes(name));
    this.chosen.parameters = Object.fromEntries(known);
    const shown = JSON.stringify([variants, parameters.map((each) => ({ ...each, value: null }))]);
    if (shown === this.shown) return;
    this.shown = shown;
    const controls = parameters.map((parameter) => this.control(parameter));
    if (variants.length > 1) controls.unshift(this.variants(variants));
    this.element.replaceChildren(...controls, this.reset);
    this.element.hidden = controls.length === 0;
    this.reset.hidden = this.chosen.variant === null && known.length === 0;
  }

  variants(variants) {
    const options = variants.map(({ name }) => [name ?? "", name ?? "as written"]);
    return labelled("variant", choice(options, this.chosen.variant ?? "", (name) => this.use({ variant: name || null })));
  }

  control(parameter) {
    const { name, kind, choices, value } = parameter;
    const changed = (to) => this.set(name, to);
    if (kind === "bool") {
      const box = make("input", { type: "checkbox", checked: value, onchange: () => changed(box.checked) });
      return labelled(name, box);
    }
    if (kind === "choice") return labelled(name, choice(choices.map((each) => [each, each]), value, changed));
    return this.slider(parameter, changed);
  }

  slider(parameter, changed) {
    const { name, kind, low, high, value, doc } = parameter;
    const [min, max] = reach(parameter);
    const step = kind === "int" ? 1 : "any";
    const number = make("input", { type: "number", "aria-label": `${name} as a number`, min: low, max: high, step, value });
    const range = make("input", { type: "range", min, max, step, value });
    range.addEventListener("input", () => {
      number.value = Number(range.valueAsNumber.toPrecision(3));
      changed(number.valueAsNumber);
    });
    number.addEventListener("input", () => {
      if (!number.checkValidity() || number.value === "") return;
      range.value = number.value;
      changed(number.valueAsNumber);
    });
    return make("div", { class: "slider", title: doc ?? short(value) }, labelled(name, range), number);
  }
}
