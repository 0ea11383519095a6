// The tab Play: an episode by keyboard or mouse, each move with its exact regret.

import { Part, make, picture, short, table } from "./dom.js";

const ARROWS = { ArrowLeft: "←", ArrowRight: "→", ArrowUp: "↑", ArrowDown: "↓" };

export class PlayTab {
  constructor(studio) {
    this.studio = studio;
    this.seed = 0;
    this.moves = [];
    this.actions = [];
    this.episode = { ended: null, legal: [], steps: [] };
    this.part = new Part("Episode");
    this.buttons = make("div", { class: "row moves", role: "group", "aria-label": "Actions" });
    this.next = make("button", { onclick: () => this.begin(this.seed + 1) }, make("kbd", {}, "Enter"), " next episode");
    const undo = make("button", { onclick: () => this.undo() }, make("kbd", {}, "Backspace"), " undo");
    this.content = [this.buttons, make("div", { class: "row" }, undo, this.next), this.part.element];
  }

  /** Follow a key; return whether it means something here. */
  key({ key, target }) {
    const index = this.actions.findIndex((action) => action.key === key);
    if (index >= 0) this.move(index);
    else if (key === "Backspace") this.undo();
    else if (key === "Enter" && target.localName !== "button") this.begin(this.seed + 1);
    else return false;
    return true;
  }

  async refresh(page) {
    const { ok, outdated, actions } = await page;
    if (!ok || outdated) return;
    if (JSON.stringify(actions ?? []) !== JSON.stringify(this.actions)) {
      this.actions = actions ?? [];
      this.moves = [];
      this.buttons.replaceChildren(...this.actions.map(({ name, key }, i) =>
        make("button", { onclick: () => this.move(i) }, make("kbd", {}, ARROWS[key] ?? key), ` ${name}`)));
    }
    this.ask();
  }

  ask() {
    const message = "This task has more actions than there are keys. Rollouts shows episodes of policies.";
    const cannot = { ok: false, message };
    const asked = this.actions.length ? this.studio.ask("play", { seed: this.seed, actions: this.moves }) : cannot;
    this.part.follow(asked, (episode) => {
      this.episode = episode;
      this.mark(episode);
      return this.drawn(episode);
    });
  }

  move(index) {
    const { ended, legal, steps } = this.episode;
    if (ended || !legal[index] || steps.length !== this.moves.length) return;
    this.moves.push(index);
    this.ask();
  }

  undo() {
    this.moves.pop();
    this.ask();
  }

  begin(seed) {
    this.seed = seed;
    this.moves = [];
    this.ask();
  }

  /** Show which actions can be taken. */
  mark({ ended, legal }) {
    [...this.buttons.children].forEach((button, i) => {
      button.setAttribute("aria-disabled", String(ended !== null || !legal[i]));
    });
    this.next.classList.toggle("main", ended !== null);
  }

  drawn({ figure, caption, time, horizon, ended, regret, state, observation, steps, return: total }) {
    const facts = {
      time: horizon === null ? String(time) : `${time} of ${horizon}`,
      state: state.map(({ name, value }) => `${name} = ${value}`).join(", "),
      observation,
      return: short(total),
      regret: regret === null ? "not known: there is no exact model" : short(regret),
    };
    const list = Object.entries(facts).map(([name, value]) => make("div", {}, make("dt", {}, name), make("dd", {}, value)));
    const end = make("p", { role: "status", class: "end" }, ended ? `The episode is over: ${ended}.` : "");
    const titles = ["step", "action", "reward", "return", "regret", "state"];
    const rows = steps.map((step, i) => [
      String(i + 1), step.action, short(step.reward), short(step.return), step.regret_text ?? "–", step.state,
    ]);
    const beside = make("div", {}, make("dl", { class: "facts" }, ...list), end);
    const now = make("div", { class: "beside" }, make("div", {}, ...picture(figure, caption)), beside);
    return rows.length ? [now, table("Moves", titles, rows.reverse())] : [now];
  }
}
