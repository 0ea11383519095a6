// The editor: CodeMirror as a client of the language server.

import * as cm from "./codemirror.js";
import { make, quiet } from "./dom.js";

const PLAIN = new Set(["p", "code", "pre", "em", "strong", "ul", "ol", "li", "br", "hr", "h1", "h2", "h3", "span"]);
const colours = cm.HighlightStyle.define([
  { tag: [cm.tags.propertyName, cm.tags.definition(cm.tags.propertyName)], class: "code-key" },
  { tag: [cm.tags.comment, cm.tags.lineComment], class: "code-comment" },
]);

const setMarks = cm.StateEffect.define();
const setTokens = cm.StateEffect.define();

/** Return a field of decorations that an effect replaces and that move with the text. */
function decorations(effect) {
  return cm.StateField.define({
    create: () => cm.Decoration.none,
    update: (shown, change) => {
      const replaced = change.effects.find((each) => each.is(effect));
      return replaced ? replaced.value : shown.map(change.changes);
    },
    provide: (field) => cm.EditorView.decorations.from(field),
  });
}

const fields = [decorations(setMarks), decorations(setTokens)];

/** Keep the plain elements of HTML, without attributes: it comes from specs, which are not trusted. */
function plain(html) {
  const { body } = new DOMParser().parseFromString(html, "text/html");
  for (const each of body.querySelectorAll("*")) {
    if (!PLAIN.has(each.localName)) each.replaceWith(each.textContent);
    for (const { name } of [...each.attributes]) each.removeAttribute(name);
  }
  return body.innerHTML;
}

/** Connect a client to a language server over a websocket. */
function connect(address, client) {
  const socket = new WebSocket(address);
  const send = (message) => socket.send(message);
  const subscribe = (handler) => socket.addEventListener("message", ({ data }) => handler(data));
  socket.addEventListener("open", () => client.connect({ send, subscribe, unsubscribe: () => socket.close() }));
}

/** Return decorations of tokens, each given relative to the one before: line, column, length, kind and modifiers. */
function coloured(doc, data, kinds) {
  const found = [];
  let line = 0;
  let column = 0;
  for (let i = 0; i < data.length; i += 5) {
    column = data[i] === 0 ? column + data[i + 1] : data[i + 1];
    line += data[i];
    const from = doc.line(line + 1).from + column;
    found.push(cm.Decoration.mark({ class: `code-${kinds[data[i + 3]]}` }).range(from, from + data[i + 2]));
  }
  return cm.Decoration.set(found);
}

export class Editor {
  /** Edit in `parent` and list mistakes in `list`; `changed` is called when the text has changed. */
  constructor(parent, list, address, changed) {
    this.list = list;
    this.changed = changed;
    this.problems = [];
    this.language = new cm.Compartment();
    this.client = new cm.LSPClient({
      timeout: 10000,
      sanitizeHTML: plain,
      notificationHandlers: { "textDocument/publishDiagnostics": (client, found) => this.report(found) },
      extensions: [
        cm.serverCompletion(), cm.hoverTooltips(),
        cm.keymap.of([...cm.renameKeymap, ...cm.jumpToDefinitionKeymap, ...cm.findReferencesKeymap]),
      ],
    });
    this.view = new cm.EditorView({ parent });
    connect(address, this.client);
  }

  get text() {
    return this.view.state.doc.toString();
  }

  /** Show a text as the document with an address. */
  open(uri, text) {
    this.view.setState(cm.EditorState.create({ doc: text, extensions: this.extensions(uri) }));
  }

  /** Tell the language server that the document is saved, under this address. */
  saved(uri) {
    const { uri: before } = cm.LSPPlugin.get(this.view);
    if (uri !== before) this.view.dispatch({ effects: this.language.reconfigure(this.client.plugin(uri, "yaml")) });
    this.client.sync();
    this.client.notification("textDocument/didSave", { textDocument: { uri } });
  }

  extensions(uri) {
    return [
      this.language.of(this.client.plugin(uri, "yaml")),
      cm.yaml(), cm.syntaxHighlighting(colours), fields, cm.indentUnit.of("  "), cm.indentOnInput(), cm.history(),
      cm.lineNumbers(), cm.foldGutter(), cm.lintGutter(), cm.drawSelection(), cm.bracketMatching(), cm.closeBrackets(),
      cm.highlightActiveLine(), cm.highlightActiveLineGutter(), cm.EditorView.lineWrapping,
      cm.tooltips({ parent: document.body }),
      cm.keymap.of([
        { key: "Mod-.", run: () => this.fix() }, cm.indentWithTab, ...cm.closeBracketsKeymap, ...cm.completionKeymap,
        ...cm.lintKeymap, ...cm.searchKeymap, ...cm.historyKeymap, ...cm.foldKeymap, ...cm.defaultKeymap,
      ]),
      cm.EditorView.contentAttributes.of({ "aria-label": "Text of the spec", tabindex: "0" }),
      cm.EditorView.updateListener.of((update) => update.docChanged && this.changed()),
    ];
  }

  /** Mark the mistakes that the language server has found, with their fixes, and colour names by what they mean. */
  async report({ uri, version, diagnostics }) {
    const plugin = cm.LSPPlugin.get(this.view);
    const file = this.client.workspace.getFile(uri);
    if (!file || plugin?.uri !== uri || (version ?? file.version) !== file.version) return;
    const doc = plugin.syncedDoc;
    const textDocument = { uri };
    const range = { start: { line: 0, character: 0 }, end: plugin.toPosition(doc.length, doc) };
    const [fixes, tokens] = await Promise.all([
      this.client.request("textDocument/codeAction", { textDocument, range, context: { diagnostics } }),
      this.client.request("textDocument/semanticTokens/full", { textDocument }),
    ]);
    if (this.view.state.doc !== doc) return;
    const kinds = this.client.serverCapabilities.semanticTokensProvider.legend.tokenTypes;
    this.problems = diagnostics.map((found) => this.problem(doc, found, fixes ?? []));
    this.view.dispatch({ effects: setTokens.of(coloured(doc, tokens?.data ?? [], kinds)) });
    this.view.dispatch(cm.setDiagnostics(this.view.state, this.problems));
    this.list.replaceChildren(...this.listed());
  }

  /** Return a mistake of a text with its fixes, which change that text only. */
  problem(doc, { range, severity, message, code }, fixes) {
    const offset = ({ line, character }) => doc.line(line + 1).from + character;
    const place = ({ start, end }) => ({ from: offset(start), to: offset(end) });
    const same = (other) => JSON.stringify(other.range) === JSON.stringify(range) && other.code === code;
    const apply = (edits) => {
      const changes = edits.map((each) => ({ ...place(each.range), insert: each.newText }));
      if (this.view.state.doc === doc) this.view.dispatch({ changes });
    };
    const own = fixes.filter((fix) => fix.diagnostics.some(same));
    const actions = own.map(({ title, edit }) => ({ name: title, apply: () => apply(Object.values(edit.changes)[0]) }));
    const kind = severity === 1 ? "error" : "warning";
    return { ...place(range), severity: kind, message, line: range.start.line + 1, actions };
  }

  /** Return the mistakes as lines below the editor, errors before warnings, each with its fixes. */
  listed() {
    const errors = this.problems.filter(({ severity }) => severity === "error");
    const lines = [...new Set([...errors, ...this.problems])].map(({ line, severity, message, actions }) => {
      const place = make("button", { class: "place", onclick: () => this.goTo(line) }, `line ${line}`);
      const fixes = actions.map(({ name, apply }) => make("button", { class: "fix", onclick: apply }, name));
      return make("p", { class: severity }, place, ` ${message.split("\n")[0]} `, ...fixes);
    });
    return lines.length ? lines : [quiet("no mistakes")];
  }

  /** Apply the first fix on the line of the cursor; return whether there is one. */
  fix() {
    const { number } = this.view.state.doc.lineAt(this.view.state.selection.main.head);
    const fix = this.problems.find(({ line, actions }) => line === number && actions.length)?.actions[0];
    fix?.apply();
    return Boolean(fix);
  }

  /** Mark lines of the spec, which count from 1, and show the first of them. */
  mark(lines) {
    const { doc } = this.view.state;
    const starts = lines.filter((line) => line <= doc.lines).map((line) => doc.line(line).from);
    const marks = starts.map((from) => cm.Decoration.line({ class: "marked" }).range(from));
    const effects = [setMarks.of(cm.Decoration.set(marks, true))];
    if (starts.length) effects.push(cm.EditorView.scrollIntoView(starts[0], { yMargin: 60 }));
    this.view.dispatch({ effects });
  }

  /** Put the cursor at the beginning of a line and show it. */
  goTo(line) {
    const { doc } = this.view.state;
    this.view.dispatch({ selection: { anchor: doc.line(Math.min(line, doc.lines)).from }, scrollIntoView: true });
    this.view.focus();
  }
}
