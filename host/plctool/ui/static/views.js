// The tables of tasks, log and devices, and the exception with its source.

import { element } from "./dom.js";

// Returns a table; cells are texts or elements, numbers are aligned right.
function table(heads, rows) {
  const line = (cells, tag) => {
    const row = element("tr");
    for (const cell of cells) row.append(element(tag, typeof cell === "number" ? "number" : "", cell ?? ""));
    return row;
  };
  const body = element("tbody", "", ...rows.map((cells) => line(cells, "td")));
  const head = element("thead", "", line(heads, "th"));
  if (rows.length) rows[0].forEach((cell, i) => head.rows[0].cells[i].classList.toggle("number", typeof cell === "number"));
  return element("table", "", head, body);
}

const note = (text) => element("p", "empty", text);

export function tasksView(tasks) {
  if (tasks.message) return [note(tasks.message)];
  if (!tasks.length) return [note("The program has no tasks.")];
  const rows = tasks.map((t) => [
    t.name, t.interval_us ? `${t.interval_us / 1000} ms` : "event", t.priority, t.cycles, t.last_us, t.avg_us, t.min_us,
    t.max_us, t.jitter_us, t.overruns,
  ]);
  const heads = ["Task", "Interval", "Priority", "Cycles", "Last µs", "Average µs", "Shortest µs", "Longest µs", "Jitter µs", "Overruns"];
  return [table(heads, rows)];
}

export function logView(entries) {
  if (entries.message) return [note(entries.message)];
  if (!entries.length) return [note("The log is empty.")];
  const rows = [...entries].reverse().map((e) => {
    const kind = element("span", `chip ${e.class}`, e.class);
    const where = e.file ? ` (${e.pou}, ${e.file}:${e.line})` : "";
    return [`${e.time_s.toFixed(3)} s`, kind, e.text + where, e.component];
  });
  return [table(["Time", "Kind", "Message", "Component"], rows)];
}

const WORDS = { UNACKNOWLEDGED: "active, new", ACKNOWLEDGED: "active", RETURNED: "gone, new" };

// Returns the words for a state of an alarm.
export const alarmState = (state) => WORDS[state] ?? state;

// Returns a button that acknowledges an alarm, or nothing if the alarm does not wait for that.
export function alarmButton({ name, state }, acknowledge) {
  if (state !== "UNACKNOWLEDGED" && state !== "RETURNED") return "";
  const button = element("button", "acknowledge", "Acknowledge");
  button.ariaLabel = `Acknowledge ${name}`;
  button.onclick = () => acknowledge(name).catch((reason) => { button.title = reason.message; });
  return button;
}

// `acknowledge(name)` returns a promise.
export function alarmsView(alarms, acknowledge) {
  if (alarms.message) return [note(alarms.message)];
  if (!alarms.length) return [note("No alarms.")];
  const kind = (a) => element("span", `chip ${a.priority === 1 ? "error" : a.priority === 2 ? "warning" : "info"}`, a.class);
  const rows = alarms.map((a) => [alarmState(a.state), kind(a), a.since ?? "", a.name, a.text, alarmButton(a, acknowledge)]);
  return [table(["State", "Class", "Since", "Alarm", "Text", ""], rows)];
}

// `value(name)` returns the element that shows a variable.
export function ioView(io, value) {
  if (io.message) return [note(io.message)];
  const parts = [];
  if (io.devices.length) {
    const rows = io.devices.map((d) => [
      d.name, d.driver, element("span", `chip ${d.state === "ok" ? "info" : d.state === "starting" ? "warning" : "error"}`, d.state),
      d.age_ms === null ? "–" : `${d.age_ms} ms`, d.errors, d.skipped,
    ]);
    parts.push(element("h2", "", "Devices"), table(["Device", "Driver", "State", "Age", "Errors", "Skipped"], rows));
  }
  if (io.channels.length) {
    const rows = io.channels.map((c) => [
      `${c.device}.${c.channel}`, value(c.variable), c.output ? "output" : "input", c.variable, c.type, c.address,
    ]);
    parts.push(element("h2", "", "Channels"), table(["Channel", "Value", "Direction", "Variable", "Type", "Address"], rows));
  }
  return parts.length ? parts : [note("The program has no inputs and outputs but memory.")];
}

export function exceptionView(exception) {
  const task = exception.task ? ` in task ${exception.task}` : "";
  const detail = exception.detail ? `: ${exception.detail}` : "";
  const parts = [element("strong", "", `The program stopped: ${exception.name}${task}${detail}`)];
  if (exception.file) parts.push(element("p", "", `${exception.pou}, ${exception.file}:${exception.line}`));
  for (const call of exception.calls) parts.push(element("p", "", `called from ${call.pou}, ${call.file}:${call.line}`));
  if (exception.source.length) {
    const lines = exception.source.map(({ line, text }) =>
      element("div", line === exception.line ? "line here" : "line", element("span", "number", line), text || " "));
    parts.push(element("pre", "source", ...lines));
  }
  return parts;
}
