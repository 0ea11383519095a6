// The page of `taskspec.tools.notebook.Explorer`: it shows `view`, and sends what is asked for.

const STYLE = `
.taskspec { display: grid; gap: 0.6em; padding: 0.3em; max-width: 60em; font: inherit; }
.taskspec .figure { background: #fff; padding: 0.4em; overflow-x: auto; border: 1px solid #8884; border-radius: 4px; }
.taskspec .row { display: flex; flex-wrap: wrap; gap: 0.4em; align-items: center; }
.taskspec button[aria-pressed="true"] { font-weight: bold; text-decoration: underline; }
.taskspec table { border-collapse: collapse; font-size: 0.9em; }
.taskspec td, .taskspec th { padding: 0.15em 0.6em; text-align: left; border-bottom: 1px solid #8884; }
`;

function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

function table(caption, head, rows) {
  const cells = (tag, row) => element("tr", {}, ...row.map((cell) => element(tag, { textContent: cell })));
  const body = element("tbody", {}, ...rows.map((row) => cells("td", row)));
  return element("table", {}, element("caption", { textContent: caption }), element("thead", {}, cells("th", head)), body);
}

const short = (number) => String(Math.round(number * 1e6) / 1e6);

function tabs(view, send) {
  const tab = (name, title) => {
    const button = element("button", { textContent: title, onclick: () => send({ plan: name, time: view.time || 0 }) });
    button.setAttribute("aria-pressed", String(view.plan === name));
    return button;
  };
  const row = element("div", { className: "row" }, tab("", "play"));
  row.append(...view.plans.map((name) => tab(name, `values: ${name}`)));
  return row;
}

function controls(view, send) {
  const row = element("div", { className: "row" });
  if (!view.keys) {
    row.append("This task cannot be played with buttons: its actions are not a short list.");
    return row;
  }
  view.keys.forEach(({ name, key }, action) => {
    const best = view.best && view.best.includes(action) ? " ★" : "";
    const title = `${name}${best}`;
    const disabled = Boolean(view.ended) || !(view.legal || [])[action];
    row.append(element("button", { textContent: title, title: `key ${key}`, disabled, onclick: () => send({ act: action }) }));
  });
  row.append(element("button", { textContent: "undo", onclick: () => send({ undo: true }) }));
  row.append(element("button", { textContent: "again", onclick: () => send({ again: true }) }));
  return row;
}

function episode(view) {
  const rows = view.steps.map((step, t) => [
    String(t + 1), step.action, short(step.reward), short(step.return), step.regret_text ?? "", step.state,
  ]);
  const lost = view.regret === null || !rows.length ? "" : `, ${short(view.regret)} less than the best actions`;
  const ending = view.ended ? `${view.ended}: ` : "";
  return table(`${ending}return ${short(view.return)}${lost}`, ["step", "action", "reward", "return", "regret", "state"], rows);
}

function clock(view, send) {
  if (!view.horizon) return "";
  const go = (event) => send({ plan: view.plan, time: Number(event.target.value) });
  const slider = element("input", { type: "range", min: 0, max: view.horizon - 1, value: view.time, onchange: go });
  slider.setAttribute("aria-label", "time");
  return element("label", { className: "row" }, `t = ${view.time}`, slider);
}

function states(view) {
  const rows = view.states.map((state) => [
    state.label, short(state.value), ...state.q.map((q, a) => `${short(q)} (${Math.round(100 * state.policy[a])} %)`),
  ]);
  return table(`V, and Q with probabilities of actions, at t = ${view.time}`, ["state", "V", ...view.actions], rows);
}

function render({ model, el }) {
  const send = (message) => model.send(message);
  const root = element("div", { className: "taskspec", tabIndex: 0 });
  root.setAttribute("role", "group");
  const draw = () => {
    const view = model.get("view");
    root.setAttribute("aria-label", view.name);
    const figure = element("div", { className: "figure" });
    figure.innerHTML = view.figure || ""; // drawn by taskspec, with all text escaped
    root.replaceChildren(element("style", { textContent: STYLE }), tabs(view, send));
    if (view.problem) root.append(view.problem);
    else if (view.plan) root.append(figure, clock(view, send), states(view));
    else root.append(figure, view.caption, controls(view, send), episode(view));
  };
  root.addEventListener("keydown", (event) => {
    const view = model.get("view");
    const action = view.plan || view.ended ? -1 : (view.keys || []).findIndex(({ key }) => key === event.key);
    if (action < 0 || !(view.legal || [])[action]) return;
    event.preventDefault();
    event.stopPropagation();
    send({ act: action });
  });
  model.on("change:view", draw);
  el.append(root);
  draw();
  return () => model.off("change:view", draw);
}

export default { render };
