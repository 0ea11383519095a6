// The tab Results: reports of exams and plots of sweeps in the folder.

import { Part, make, quiet } from "./dom.js";

const NONE = [
  "This folder holds no results yet. ", make("code", {}, "taskspec exam FILE.py:train -o exam"), ", run in it, examines a learner, and ",
  make("code", {}, "taskspec sweep FILE.yaml -o sweep"), " runs an experiment; cards and plots are shown here.",
];

/** Return a result in a frame or an image of its own, which is loaded once it is open: nothing of a file may run here. */
function card({ title, path, html, svg }) {
  const name = title ?? path;
  const frame = { sandbox: "", srcdoc: html, title: name };
  const image = { src: `data:image/svg+xml,${encodeURIComponent(svg)}`, alt: name };
  const head = make("summary", {}, name, " ", make("span", { class: "quiet" }, path));
  const made = make("details", { class: "result" }, head);
  const open = () => made.append(html ? make("iframe", frame) : make("img", image));
  made.addEventListener("toggle", open, { once: true });
  return made;
}

export class ResultsTab {
  constructor(studio) {
    this.studio = studio;
    this.part = new Part("Results");
    this.content = [this.part.element];
  }

  show() {
    this.part.follow(this.studio.live.ask("results"), ({ results, more }) => {
      if (results.length === 0) return [quiet(...NONE)];
      const cards = results.map(card);
      cards[0].open = true;
      return more ? [...cards, quiet(`${more} more`)] : cards;
    });
  }
}
