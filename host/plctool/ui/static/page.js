// The page of operators: lays out the elements that page.toml describes, and shows their values.

import { Connection } from "./connection.js";
import { byId, setText } from "./dom.js";
import { makeElement } from "./elements.js";

const STATES = { run: "Running", stop: "Stopped", exception: "Exception", none: "No program", "stop on breakpoint": "Halted" };

let elements = [];
let names = [];
let views = [];
let link = { connected: false };
let state = "";
let asked = "";

const connection = new Connection(onNews, onConnection);

function onNews(topic, content) {
  const takes = { page: showPage, link: showLink, status: showStatus, symbols: showSymbols, reading: showReading, values: showValues, alarms: showAlarms };
  takes[topic]?.(content);
}

function onConnection(connected, reason) {
  asked = "";
  if (connected) show();
  else showLink({ ...link, connected: false, message: reason });
}

// ---- what plctool sends ----

function showPage(page) {
  const title = page.title || "plctool";
  setText(byId("title"), title);
  document.title = title;
  byId("elements").style.setProperty("--columns", page.columns);
  elements = page.elements.map((description, number) => makeElement(description, number, operate));
  byId("elements").replaceChildren(...elements.map((one) => one.node));
  views = page.elements.some((one) => one.kind === "alarms") ? ["alarms"] : [];
  names = [...new Set(page.elements.flatMap((one) => one.items.map((item) => item.variable)))];
  show();
}

function showLink(content) {
  link = content;
  document.body.classList.toggle("lost", !link.connected);
  byId("lost").hidden = !link.message;
  setText(byId("lost"), link.connected ? link.message : `Connection lost. ${link.message} The values are old.`);
  setText(byId("device"), link.name ?? "");
  showState();
}

function showStatus(status) {
  state = status.state;
  byId("exception").hidden = !status.exception;
  setText(byId("exception"), status.exception ? `The program stopped: ${status.exception.name}` : "");
  showState();
}

function showState() {
  const shown = link.connected ? state : "lost";
  byId("state").className = `state ${shown.replaceAll(" ", "-")}`;
  setText(byId("state"), shown === "lost" ? "Not connected" : STATES[shown] ?? shown);
}

function showSymbols(content) {
  asked = ""; // another program: all values are sent again
  showProblem(content.crc ? "" : content.message);
  show();
}

function showReading({ problem }) {
  showProblem(problem);
}

function showProblem(text) {
  byId("problem").hidden = !text;
  setText(byId("problem"), text);
}

function showValues(values) {
  for (const one of elements) one.update(values);
}

function showAlarms(alarms) {
  for (const one of elements) one.showAlarms?.(alarms);
}

// ---- what is asked for ----

// Tells plctool which values are seen now.
function show() {
  const wanted = document.hidden ? { names: [], views: [] } : { names, views };
  const text = JSON.stringify(wanted);
  if (text === asked) return;
  asked = text;
  connection.ask("show", wanted).catch(() => { asked = ""; });
}

function operate(element, text) {
  return connection.ask("operate", { element, text });
}

document.addEventListener("visibilitychange", show);
