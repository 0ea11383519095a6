// The tab Results: reports of exams and plots of sweeps in the folder.

import { Part, make, quiet } from "./dom.js";

/** Return a result in a frame or an image of its own: it is from a file, and nothing in it may run. */
function shown({ title, html, svg }) {
  if (html) return make("iframe", { sandbox: "", srcdoc: html, title });
  return make("img", { src: `data:image/svg+xml,${encodeURIComponent(svg)}`, alt: title });
}

function card(result) {
  const title = result.title ?? result.path;
  const head = make("summary", {}, title, " ", make("span", { class: "quiet" }, result.path));
  const made = make("details", { class: "result" }, head);
  made.addEventListener("toggle", () => made.append(shown({ ...result, title })), { once: true });
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
      if (results.length === 0) return [quiet("This folder holds no results of taskspec exam or taskspec sweep.")];
      const cards = results.map(card);
      cards[0].open = true;
      return more ? [...cards, quiet(`${more} more`)] : cards;
    });
  }
}
