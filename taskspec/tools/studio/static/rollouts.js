// The tab Rollouts: an episode of a policy, as a film.

import { Part, labelled, make, picture, quiet, short } from "./dom.js";

const NAMES = ["random", "expert", "optimal", "soft(1)", "epsilon(0.1)"];
/** Milliseconds between frames. */
const PAUSE = 500;

export class RolloutsTab {
  constructor(studio) {
    this.studio = studio;
    this.timer = null;
    this.episode = { frames: [{ figure: null, words: "" }], length: 0, return: null };
    this.part = new Part("Episode");
    this.names = make("datalist", { id: "policies" });
    const asked = () => this.ask();
    this.policy = make("input", { list: "policies", value: "optimal", spellcheck: "false", onchange: asked });
    this.seed = make("input", { type: "number", min: 0, step: 1, value: 0, onchange: asked });
    this.place = make("input", { type: "range", min: 0, max: 0, value: 0, oninput: () => this.draw() });
    this.film = make("button", { onclick: () => this.toggle() }, "Play");
    const back = make("button", { "aria-label": "One step back", onclick: () => this.step(-1) }, "‹");
    const on = make("button", { "aria-label": "One step on", onclick: () => this.step(1) }, "›");
    this.content = [
      make("div", { class: "row" }, labelled("policy", this.policy), this.names, labelled("seed", this.seed)),
      make("div", { class: "row scrub" }, this.film, back, on, labelled("step", this.place)),
      this.part.element,
    ];
  }

  refresh() {
    const known = [...NAMES, ...this.studio.folder.policies];
    this.names.replaceChildren(...known.map((value) => make("option", { value })));
    this.ask();
  }

  ask() {
    const asked = this.studio.ask("rollout", { policy: this.policy.value, seed: this.seed.valueAsNumber || 0 });
    this.part.follow(asked, (answer) => {
      this.episode = answer;
      this.place.max = answer.frames.length - 1;
      return this.drawn();
    });
  }

  drawn() {
    const { frames, length, return: total } = this.episode;
    const { figure, words } = frames[this.place.valueAsNumber];
    const where = `step ${this.place.value} of ${length}: ${words}`;
    this.place.setAttribute("aria-valuetext", where);
    return [make("p", {}, where), quiet(`return of the episode: ${short(total)}`), ...picture(figure)];
  }

  draw() {
    this.part.content.replaceChildren(...this.drawn());
  }

  step(change) {
    this.place.value = this.place.valueAsNumber + change;
    this.draw();
  }

  toggle() {
    if (this.timer !== null) return this.hide();
    if (this.place.value === this.place.max) this.place.value = 0;
    this.draw();
    this.film.textContent = "Pause";
    this.timer = setInterval(() => {
      this.step(1);
      if (this.place.value === this.place.max) this.hide();
    }, PAUSE);
  }

  /** Stop the film. */
  hide() {
    clearInterval(this.timer);
    this.timer = null;
    this.film.textContent = "Play";
  }
}
