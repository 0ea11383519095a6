// The page of `taskspec studio`: an editor, and what its text means, following the text.

import { byId, make } from "./dom.js";
import { Editor } from "./editor.js";
import { Files } from "./files.js";
import { Live } from "./live.js";
import { PlayTab } from "./play.js";
import { ResultsTab } from "./results.js";
import { RolloutsTab } from "./rollouts.js";
import { Settings } from "./settings.js";
import { SpecTab } from "./spec.js";
import { SweepTab } from "./sweep.js";
import { ValuesTab } from "./values.js";

/** Milliseconds without a key after which the text is sent. */
const PAUSE = 25;
const TABS = {
  Spec: SpecTab, Play: PlayTab, Values: ValuesTab, Rollouts: RolloutsTab, Sweep: SweepTab, Results: ResultsTab,
};
const NAMES = Object.keys(TABS);

function address(name) {
  const token = new URLSearchParams(location.search).get("token");
  return `ws://${location.host}/${name}?token=${encodeURIComponent(token)}`;
}

class Studio {
  constructor() {
    this.live = new Live(address("live"), () => this.say("The studio has ended; the text can still be copied.", true));
    this.editor = new Editor(byId("editor"), byId("problems"), address("lsp"), () => this.edited());
    this.settings = new Settings(byId("settings"), () => this.change());
    this.files = new Files(this);
    this.tabs = Object.fromEntries(NAMES.map((name) => [name, this.tab(name)]));
    this.show("Spec");
  }

  tab(name) {
    const tab = new TABS[name](this);
    const button = make("button", { role: "tab", id: `tab-${name}`, "aria-controls": `panel-${name}` }, name);
    const attributes = { role: "tabpanel", id: `panel-${name}`, "aria-labelledby": button.id, tabindex: 0 };
    const panel = make("div", attributes, ...tab.content);
    button.addEventListener("click", () => {
      this.show(name);
      panel.focus();
    });
    byId("tabs").append(button);
    byId("panel").append(panel);
    return tab;
  }

  /** Show a tab. */
  show(name) {
    this.tabs[this.shown]?.hide?.();
    this.shown = name;
    for (const each of NAMES) {
      const button = byId(`tab-${each}`);
      button.setAttribute("aria-selected", String(each === name));
      button.tabIndex = each === name ? 0 : -1;
      byId(`panel-${each}`).hidden = each !== name;
    }
    if (this.page) this.tabs[name].refresh?.(this.page);
    this.tabs[name].show?.();
  }

  /** Ask a question about the text with its settings. */
  ask(kind, fields = {}) {
    return this.live.ask(kind, { text: this.editor.text, path: this.files.path, settings: this.settings.chosen, ...fields });
  }

  /** Let everything that is shown follow the text and the settings. */
  async change() {
    this.page = this.ask("page");
    this.tabs[this.shown].refresh?.(this.page);
    const known = await this.page;
    if (known.outdated) return;
    byId("stale").hidden = known.ok;
    if (known.ok) this.settings.show(known);
    else byId("stale").textContent = `Shown is the last text without mistakes: ${known.message}`;
  }

  edited() {
    clearTimeout(this.pause);
    this.pause = setTimeout(async () => {
      this.files.named();
      await this.change();
      this.editor.client.sync();
    }, PAUSE);
  }

  /** Say something above the page: for a while, or until something else is said; actions are names with functions. */
  say(text, isProblem = false, actions = {}) {
    const notice = byId("notice");
    const buttons = Object.entries(actions).map(([name, act]) => make("button", { onclick: act }, name));
    notice.replaceChildren(text, " ", ...buttons);
    notice.className = isProblem ? "problem" : "";
    notice.hidden = false;
    clearTimeout(this.notice);
    if (!isProblem) this.notice = setTimeout(() => (notice.hidden = true), 4000);
  }
}

/** Follow the keys of the whole page, and of the row of tabs. */
function keys(studio) {
  const go = (name) => {
    studio.show(name);
    byId(`tab-${name}`).focus();
  };
  const ofPage = { s: () => studio.files.save(), o: () => studio.files.choose() };
  document.addEventListener("keydown", (event) => {
    const control = event.ctrlKey || event.metaKey;
    const isPlayed = studio.shown === "Play" && !control && !event.altKey && byId("panel-Play").contains(event.target);
    if (control && ofPage[event.key]) ofPage[event.key]();
    else if (event.altKey && NAMES[event.key - 1]) go(NAMES[event.key - 1]);
    else if (!isPlayed || !studio.tabs.Play.key(event)) return;
    event.preventDefault();
  });
  byId("tabs").addEventListener("keydown", ({ key }) => {
    const change = { ArrowRight: 1, ArrowLeft: NAMES.length - 1 }[key];
    if (change) go(NAMES[(NAMES.indexOf(studio.shown) + change) % NAMES.length]);
  });
}

/** Let the divider between editor and panel be moved by pointer and arrow keys. */
function divider() {
  const bar = byId("divider");
  const place = (percent) => {
    const width = Math.round(Math.min(80, Math.max(20, percent)));
    bar.parentElement.style.setProperty("--editor", `${width}%`);
    bar.setAttribute("aria-valuenow", width);
  };
  bar.addEventListener("pointerdown", ({ pointerId }) => bar.setPointerCapture(pointerId));
  bar.addEventListener("pointermove", ({ pointerId, clientX }) => {
    if (bar.hasPointerCapture(pointerId)) place((100 * clientX) / innerWidth);
  });
  bar.addEventListener("keydown", ({ key }) => {
    const change = { ArrowRight: 2, ArrowLeft: -2 }[key];
    if (change) place(Number(bar.getAttribute("aria-valuenow")) + change);
  });
}

/** Switch between light and dark; the choice is kept. */
function theme() {
  const root = document.documentElement;
  const system = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
  if (localStorage.theme) root.dataset.theme = localStorage.theme;
  byId("theme").addEventListener("click", () => {
    localStorage.theme = (root.dataset.theme ?? system) === "dark" ? "light" : "dark";
    root.dataset.theme = localStorage.theme;
  });
}

/** Mark a state wherever it is drawn or printed while it is pointed at. */
function states() {
  const known = (each) => each?.dataset.state ?? each?.dataset.of;
  byId("panel").addEventListener("pointerover", ({ target }) => {
    const code = known(target.closest("[data-state], [data-of]"));
    for (const each of byId("panel").querySelectorAll("[data-state], [data-of]")) {
      each.classList.toggle("marked", code !== undefined && known(each) === code);
    }
  });
}

const studio = new Studio();
keys(studio);
divider();
theme();
states();
byId("help").addEventListener("click", () => byId("keys").showModal());
addEventListener("beforeunload", (event) => studio.files.isUnsaved && event.preventDefault());
studio.files.start();
