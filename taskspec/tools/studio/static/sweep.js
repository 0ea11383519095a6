// The tab Sweep: exact returns over the values of a parameter.

import { Part, labelled, make, picture, rounded, short, table } from "./dom.js";

const CURVES = ["optimal", "expert", "random", "worst"];

export class SweepTab {
  constructor(studio) {
    this.studio = studio;
    this.part = new Part("Exact returns over a parameter");
    this.names = make("select", { onchange: () => this.ask() });
    this.values = make("input", { placeholder: "1, 2, 5, 10", autocomplete: "off", onchange: () => this.ask() });
    this.controls = make("div", { class: "row" }, labelled("parameter", this.names), labelled("values", this.values));
    this.content = [this.controls, this.part.element];
  }

  async refresh(page) {
    const { ok, outdated, parameters } = await page;
    if (!ok || outdated) return;
    const chosen = this.names.value;
    const numbers = parameters.filter(({ kind }) => kind === "int" || kind === "real");
    this.names.replaceChildren(...numbers.map(({ name }) => make("option", { selected: name === chosen }, name)));
    this.controls.hidden = numbers.length === 0;
    this.ask();
  }

  ask() {
    const parameter = this.names.value;
    const values = this.values.value.split(/[\s,;]+/).filter(Boolean).map(Number).filter(Number.isFinite);
    const message = "No parameter of this spec is a number. A number under `parameters:` can be swept here.";
    const cannot = { ok: false, message };
    const asked = parameter ? this.studio.ask("sweep", { parameter, ...(values.length && { values }) }) : cannot;
    this.part.follow(asked, (answer) => this.drawn(answer));
  }

  /** Show the values that are known, and ask again while there are others. */
  drawn({ chart, parameter, rows, left }) {
    if (left.length) this.ask();
    const cells = (row) => (row.error ? [row.error] : CURVES.map((curve) => rounded(row[curve] ?? null)));
    const values = rows.map((row) => [short(row.value), ...cells(row)]);
    return [...picture(chart), table("Returns", [parameter, ...CURVES], values)];
  }
}
