// The tab Spec: figure, exact scores, printed mathematics and claims.

import { Part, make, picture, quiet, written } from "./dom.js";

const SIGNS = new Map([[true, ["✓", "holds"]], [false, ["✗", "fails"]], [null, ["?", "open"]]]);

function score({ label, html, exact, estimated }) {
  const fraction = exact?.includes("/") ? exact.replace("-", "−") : "";
  const about = estimated ? "estimated" : fraction;
  return make("tr", {}, make("th", { scope: "row" }, label), written("td", {}, html), make("td", { class: "quiet" }, about));
}

export class SpecTab {
  constructor(studio) {
    this.studio = studio;
    this.figure = new Part("Figure");
    this.scores = new Part("Exact scores");
    this.mathematics = new Part("Printed mathematics", { class: "printed" });
    this.claims = new Part("Claims", { class: "claims" });
    const first = make("div", { class: "beside" }, this.figure.element, this.scores.element);
    this.content = [first, this.mathematics.element, this.claims.element];
  }

  refresh(page) {
    this.figure.follow(page, ({ figure, caption }) => picture(figure, caption));
    this.mathematics.follow(page, ({ mathematics }) => [written("div", {}, mathematics)]);
    const scores = this.studio.ask("scores");
    this.scores.follow(scores, (answer) => this.drawn(answer));
    const claims = scores.then((answer) => (answer.ok && !answer.outdated ? this.studio.ask("claims") : answer));
    this.claims.follow(claims, (answer) => this.judged(answer.claims));
  }

  drawn({ title, rows, remark }) {
    const scores = make("table", { class: "scores" }, make("tbody", {}, ...rows.map(score)));
    return [make("h2", {}, title), scores, ...(remark ? [quiet(remark)] : [])];
  }

  judged(claims) {
    const holding = claims.filter(({ holds }) => holds).length;
    const count = claims.length ? `${holding} of ${claims.length} claims hold` : "no claims";
    return [make("h2", {}, count), make("ul", {}, ...claims.map((claim) => this.claim(claim)))];
  }

  claim({ text, holds, words, detail, line }) {
    const [sign, kind] = SIGNS.get(holds);
    const place = make("button", { class: "place", onclick: () => this.studio.editor.goTo(line) }, make("code", {}, text));
    const mark = make("span", { "aria-hidden": "true" }, `${sign} `);
    return make("li", {}, place, make("span", { class: `mark ${kind}`, title: detail }, mark, words));
  }
}
