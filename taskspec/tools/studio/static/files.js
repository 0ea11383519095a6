// Files of the folder: open, begin, save; copies of the task in other forms; texts shared in addresses.

import { byId, make } from "./dom.js";

/** Return a text as letters of an address, compressed. */
async function packed(text) {
  const stream = new Blob([text]).stream().pipeThrough(new CompressionStream("deflate-raw"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  return btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join("")).replaceAll("+", "-").replaceAll("/", "_");
}

function unpacked(letters) {
  const bytes = Uint8Array.from(atob(letters.replaceAll("-", "+").replaceAll("_", "/")), (each) => each.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"))).text();
}

export class Files {
  constructor(studio) {
    this.studio = studio;
    this.path = null;
    this.kept = "";
    byId("open").addEventListener("click", () => this.choose());
    byId("save").addEventListener("click", () => this.save());
    byId("share").addEventListener("click", () => this.share());
    byId("filter").addEventListener("input", () => this.list());
    byId("filter").addEventListener("keydown", (event) => this.enter(event));
    for (const button of byId("forms").children) button.addEventListener("click", () => this.copy(button));
    addEventListener("hashchange", () => this.loadShared());
  }

  get isUnsaved() {
    return this.studio.editor.text !== this.kept;
  }

  mayLeave() {
    return !this.isUnsaved || confirm("Leave this text without saving it?");
  }

  /** Show what the address shares, else the spec that the command was given, else the first of the folder that has a figure, else a template. */
  async start() {
    this.studio.folder = await this.studio.live.ask("files");
    const { opened, first, templates } = this.studio.folder;
    if (await this.loadShared()) return;
    const path = opened ?? first;
    if (path) this.load("open", { path });
    else this.load("new", { from: templates[0].id, path: null });
  }

  /** Show the text and settings that the address shares; return whether it does. */
  async loadShared() {
    const [, letters] = location.hash.match(/^#spec=([\w=-]{1,100000})$/) ?? [];
    if (!letters || !this.mayLeave()) return false;
    try {
      const { text, settings } = JSON.parse(await unpacked(letters));
      this.show({ path: null, text: String(text), digest: null }, settings);
      return true;
    } catch {
      this.studio.say("The address ends in something that is not a shared text.", true);
    }
    return false;
  }

  /** Show the text of an answer to "open" or "new". */
  async load(kind, fields) {
    const answer = await this.studio.live.ask(kind, fields);
    if (answer.ok) this.show(answer);
    else this.studio.say(answer.message, true);
  }

  show({ path, digest, text, uri }, settings = null) {
    this.path = path;
    this.digest = digest ?? null;
    this.kept = text;
    this.studio.settings.choose(settings);
    this.studio.editor.open(uri ?? `${this.studio.folder.root}/untitled.yaml`, text);
    byId("file").value = path ?? "";
    this.named();
    this.studio.change();
  }

  /** Show whether the text differs from its file. */
  named() {
    byId("unsaved").textContent = this.isUnsaved ? "edited" : "";
    document.title = `${this.path ?? "new"} · taskspec studio`;
  }

  /** Ask which spec to open, or what to begin with. */
  async choose() {
    byId("filter").value = "";
    this.list();
    byId("files").showModal();
    const folder = await this.studio.live.ask("files");
    if (JSON.stringify(folder) === JSON.stringify(this.studio.folder)) return; // a new list would lose the focus of the old one
    this.studio.folder = folder;
    this.list();
  }

  list() {
    const { files, templates, library } = this.studio.folder;
    const begin = ({ id, title }) => this.choice(id.replace("template:", ""), title, "new", { from: id, path: null });
    const groups = {
      "In this folder": files.map((path) => this.choice(path, "", "open", { path })),
      "Begin with a template": templates.map(begin),
      "Begin with a task of the library": library.map(begin),
    };
    const word = byId("filter").value.toLowerCase();
    const lists = Object.entries(groups).map(([title, items]) => {
      const found = items.filter((item) => item.textContent.toLowerCase().includes(word));
      return found.length ? make("section", {}, make("h3", {}, title), make("ul", {}, ...found)) : "";
    });
    byId("choices").replaceChildren(...lists);
  }

  /** Take the first of the names where Enter is pressed. */
  enter(event) {
    if (event.key !== "Enter") return;
    event.preventDefault();
    byId("choices").querySelector("button")?.click();
  }

  choice(name, words, kind, fields) {
    const taken = () => {
      if (!this.mayLeave()) return;
      byId("files").close();
      this.load(kind, fields);
    };
    return make("li", {}, make("button", { type: "button", onclick: taken }, name, " ", make("span", { class: "quiet" }, words)));
  }

  /** Save the text to the file that is named; another name than before is that of a new file. */
  async save() {
    const path = byId("file").value;
    if (!path) {
      byId("file").focus();
      this.studio.say("Write a name for the file, such as task.yaml, and save again.");
      return;
    }
    const { text } = this.studio.editor;
    const answer = await this.studio.live.ask("save", { path, text, digest: path === this.path ? this.digest : null });
    if (!answer.ok) {
      const again = { "Open the file again": () => this.load("open", { path }) };
      this.studio.say(answer.message, true, answer.refused === "changed" ? again : {});
      return;
    }
    Object.assign(this, { path: answer.path, digest: answer.digest, kept: text });
    this.studio.editor.saved(answer.uri);
    this.named();
    this.studio.say(`Saved ${answer.path}.`);
  }

  async copy({ textContent, dataset }) {
    byId("forms").hidePopover();
    const answer = await this.studio.ask("copy", { format: dataset.format });
    if (!answer.ok) return this.studio.say(answer.message, true);
    await navigator.clipboard.writeText(answer.text);
    return this.studio.say(`Copied: ${textContent}.`);
  }

  async share() {
    const shared = { text: this.studio.editor.text, settings: this.studio.settings.chosen };
    await navigator.clipboard.writeText(`#spec=${await packed(JSON.stringify(shared))}`);
    this.studio.say("Copied the text as the end of an address: it opens behind the address of any studio.");
  }
}
