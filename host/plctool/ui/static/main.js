// The page: connects what plctool sends with what is shown.

import { Connection } from "./connection.js";
import { Diagrams } from "./diagrams.js";
import { AskDialog, EditDialog } from "./dialogs.js";
import { byId, element, setText } from "./dom.js";
import { MAX_PLOTTED, Plot } from "./plot.js";
import { Tree } from "./tree.js";
import { alarmsView, exceptionView, ioView, logView, tasksView } from "./views.js";

const VIEWS = ["variables", "diagrams", "tasks", "log", "alarms", "io"];
const SEARCH_MS = 150;
const STATES = { run: "Running", stop: "Stopped", exception: "Exception", none: "No program", "stop on breakpoint": "Halted" };

let view = "variables";
let asked = "";
let link = { connected: false };
let status = null;
const channelValues = new Map(); // name of a variable: elements that show it

const connection = new Connection(onNews, onConnection);
const edit = new EditDialog(connection);
const ask = new AskDialog();
const plot = new Plot(byId("plot"), byId("legend"), togglePlot);
const tree = new Tree(byId("tree"), {
  load: (path, start) => connection.ask("children", { path, start }),
  search: (text) => connection.ask("search", { text }),
  on: { edit: (row, value) => edit.open(row, value), plot: (row) => togglePlot(row.name), shown: show },
});

const diagrams = new Diagrams(byId("diagrams"), connection, () => show());

// ---- what plctool sends ----

function onNews(topic, content) {
  const takes = {
    link: showLink, status: showStatus, symbols: showSymbols, reading: showReading, values: showValues,
    tasks: (tasks) => fill("tasks", tasksView(tasks)),
    log: (entries) => fill("log", logView(entries)),
    alarms: (alarms) => fill("alarms", alarmsView(alarms, (name) => connection.ask("acknowledge", { name }))),
    io: showIo,
  };
  takes[topic]?.(content);
}

function onConnection(connected, reason) {
  asked = "";
  if (connected) show();
  else showLink({ ...link, connected: false, message: reason });
}

function showLink(content) {
  link = content;
  document.body.classList.toggle("lost", !link.connected);
  byId("lost").hidden = !link.message;
  byId("lost").classList.toggle("bad", !link.connected);
  byId("lost").classList.toggle("warn", link.connected);
  setText(byId("lost"), link.connected ? link.message : `Connection lost. ${link.message} The values are old.`);
  setText(byId("device"), link.name ?? "");
  showState();
}

function showStatus(content) {
  const before = JSON.stringify(status?.exception ?? null);
  status = content;
  const program = status.program;
  const name = program?.name || (status.image_crc ? `Program ${status.image_crc}` : "No program");
  setText(byId("program"), [name, program?.version].filter(Boolean).join(" "));
  document.title = `${name} – plctool`;
  showState();
  const forced = status.forced;
  byId("forced").hidden = !forced.length;
  const names = forced.length > 4 ? `${forced.slice(0, 4).join(", ")} and ${forced.length - 4} more` : forced.join(", ");
  setText(byId("forced").firstElementChild, `Forced: ${names}`);
  byId("exception").hidden = !status.exception;
  if (status.exception && JSON.stringify(status.exception) !== before) byId("exception").replaceChildren(...exceptionView(status.exception));
}

function showState() {
  const state = link.connected ? status?.state ?? "" : "lost";
  const chip = byId("state");
  chip.className = `state ${state.replaceAll(" ", "-")}`;
  setText(chip, state === "lost" ? "Not connected" : STATES[state] ?? state);
  byId("start").disabled = state !== "stop";
  byId("stop").disabled = state !== "run";
  byId("reset").hidden = state !== "exception";
}

function showSymbols(content) {
  asked = "";
  diagrams.forget();
  if (view === "diagrams") diagrams.load();
  if (content.crc) tree.reload().catch((error) => tree.clear(error.message));
  else tree.clear(content.message);
}

function showReading({ whole, problem }) {
  byId("problem").hidden = whole && !problem;
  setText(byId("problem"), problem || (whole ? "" : "A task ran while the values were read: they may be of different cycles."));
}

function showValues(values) {
  tree.update(values);
  plot.update(values);
  diagrams.update(values);
  for (const [name, [text, forced, , error]] of Object.entries(values)) {
    for (const cell of channelValues.get(name) ?? []) showChannel(cell, text, forced, error);
  }
}

// ---- what is asked for ----

// Tells plctool what is seen now.
function show() {
  const names = new Set(plot.names);
  if (view === "variables") tree.shownNames.forEach((name) => names.add(name));
  if (view === "diagrams") diagrams.names.slice(0, 300).forEach((name) => names.add(name));
  if (view === "io") [...channelValues.keys()].slice(0, 300).forEach((name) => names.add(name));
  const wanted = document.hidden ? { names: [], views: [] } : { names: [...names].sort(), views: ["variables", "diagrams"].includes(view) ? [] : [view] };
  const text = JSON.stringify(wanted);
  if (text === asked) return;
  asked = text;
  connection.ask("show", wanted).catch(() => { asked = ""; });
}

function togglePlot(name) {
  if (!plot.names.has(name) && plot.names.size === MAX_PLOTTED) return;
  plot.toggle(name);
  if (tree.values.has(name)) plot.update({ [name]: tree.values.get(name) }); // it may not change for long
  tree.setPlotted(plot.names);
  byId("trend").classList.toggle("used", plot.names.size > 0);
  asked = "";
  show();
}

// ---- views ----

function fill(id, parts) {
  byId(id).querySelector(".scroll").replaceChildren(...parts);
}

function showIo(io) {
  channelValues.clear();
  const cell = (name) => {
    const made = element("span", "value");
    channelValues.set(name, [...(channelValues.get(name) ?? []), made]);
    const [text = "", forced = false, , error = ""] = tree.values.get(name) ?? [];
    showChannel(made, text, forced, error);
    return made;
  };
  fill("io", ioView(io, cell));
  show();
}

function showChannel(cell, text, forced, error) {
  setText(cell, error || (forced ? `${text} (forced)` : text));
  cell.classList.toggle("on", text === "TRUE");
}

function choose(name) {
  view = name;
  for (const other of VIEWS) {
    byId(other).hidden = other !== name;
    const tab = byId(`tab-${other}`);
    tab.ariaSelected = other === name;
    tab.tabIndex = other === name ? 0 : -1;
  }
  if (name === "variables") plot.draw();
  if (name === "diagrams") diagrams.load();
  show();
}

VIEWS.forEach((name, i) => {
  const tab = byId(`tab-${name}`);
  tab.onclick = () => choose(name);
  tab.onkeydown = (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const next = VIEWS[(i + step + VIEWS.length) % VIEWS.length];
    choose(next);
    byId(`tab-${next}`).focus();
  };
});

// ---- commands and keys ----

byId("start").onclick = () => ask.open("Start the program?", "Start", () => connection.ask("start"));
byId("stop").onclick = () => ask.open("Stop the program? Outputs go to their safe state.", "Stop", () => connection.ask("stop"));
byId("reset").onclick = () => ask.open("Reset the program? RETAIN variables are kept.", "Reset", () => connection.ask("reset"));
byId("unforce-all").onclick = () => ask.open("End all forces?", "End all", () => connection.ask("unforce_all"));

let typing = 0;
byId("search").oninput = () => {
  clearTimeout(typing);
  typing = setTimeout(() => tree.search(byId("search").value).catch(() => {}), SEARCH_MS);
};
byId("search").onkeydown = (event) => {
  if (event.key === "Escape") {
    byId("search").value = "";
    tree.search("");
  } else if (event.key !== "ArrowDown") return;
  event.preventDefault();
  byId("tree").focus();
};
document.addEventListener("keydown", (event) => {
  if (event.key !== "/" || event.target.matches("input") || document.querySelector("dialog[open]")) return;
  event.preventDefault();
  choose("variables");
  byId("search").focus();
});
document.addEventListener("visibilitychange", show);
window.addEventListener("resize", () => tree.draw());

plot.showLegend();
plot.draw();
choose("variables");
