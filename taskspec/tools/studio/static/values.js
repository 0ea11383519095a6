// The tab Values: values and a policy over states and time.

import { Part, choice, labelled, make, picture, quiet, rounded, short, table } from "./dom.js";

const PLANS = [
  ["optimal", "optimal"], ["soft", "soft"], ["maxent", "maximum entropy"], ["random", "random"], ["expert", "expert"],
];
const LAYERS = ["values", "policy", "occupancy"];

export class ValuesTab {
  constructor(studio) {
    this.studio = studio;
    this.states = new Map();
    this.part = new Part("Values");
    const asked = () => this.refresh();
    this.plan = choice(PLANS, "optimal", asked);
    this.temperature = make("input", { type: "number", min: 0.01, step: "any", value: 1, oninput: asked });
    this.heat = labelled("temperature", this.temperature);
    this.time = make("input", { type: "range", min: 0, max: 0, value: 0, oninput: asked });
    this.clock = make("output");
    const box = (value) => make("input", { type: "checkbox", value, checked: value !== "occupancy", onchange: asked });
    this.layers = LAYERS.map(box);
    const time = make("div", { class: "slider" }, labelled("time", this.time), this.clock);
    const layers = this.layers.map((box) => make("label", {}, box, box.value));
    const controls = make("div", { class: "row" }, labelled("policy", this.plan), this.heat, time, ...layers);
    this.content = [controls, this.part.element];
    this.part.element.addEventListener("pointerover", ({ target }) => this.point(target));
    this.part.element.addEventListener("focusin", ({ target }) => this.point(target));
    this.part.element.addEventListener("pointerleave", () => studio.editor.mark([]));
  }

  refresh() {
    const plan = this.plan.value;
    this.heat.hidden = plan !== "soft" && plan !== "maxent";
    const temperature = this.temperature.valueAsNumber || 1;
    const layers = this.layers.filter(({ checked }) => checked).map(({ value }) => value);
    const asked = this.studio.ask("values", { plan, temperature, time: this.time.valueAsNumber, layers });
    this.part.follow(asked, (answer) => this.drawn(answer));
  }

  drawn({ figure, time, horizon, actions, states, more }) {
    this.time.max = horizon === null ? 0 : horizon - 1;
    this.time.disabled = horizon === null;
    this.clock.textContent = horizon === null ? "without a horizon" : `${time} of ${horizon}`;
    this.states = new Map(states.map((state) => [String(state.code), state]));
    const rows = states.map((state) => [
      this.named(state), rounded(state.value), rounded(state.visits), ...actions.map((_, a) => this.action(state, a)),
    ]);
    const note = quiet("Under the name of an action: its Q-value, if it is legal, and its probability as a bar.");
    const rest = more ? [quiet(`${more} more states`)] : [];
    return [...picture(figure), table("States", ["state", "value", "visits", ...actions], rows), note, ...rest];
  }

  named({ code, label, lines }) {
    const go = () => lines.length && this.studio.editor.goTo(lines[0]);
    return make("button", { class: "place", "data-of": code, onclick: go }, label);
  }

  action({ q, policy }, a) {
    const bar = make("span", { class: "share" });
    bar.style.width = `${100 * policy[a]}%`;
    return make("span", { class: "choice", title: `probability ${short(policy[a])}` }, rounded(q[a]), bar);
  }

  /** Mark the lines of the spec that speak of the state that is pointed at. */
  point(target) {
    const place = target.closest("[data-state]") ?? target.closest("tr")?.querySelector("[data-of]");
    this.studio.editor.mark(this.states.get(place?.dataset.state ?? place?.dataset.of)?.lines ?? []);
  }
}
