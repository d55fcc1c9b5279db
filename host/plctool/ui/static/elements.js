// The elements of an operators' page. Each is {node, update(values)}, that of alarms also has showAlarms(alarms); `values` has [text, forced, number, error] by name.

import { element, setText } from "./dom.js";
import { Plot } from "./plot.js";
import { alarmButton, alarmState } from "./views.js";

const UNQUOTED = /^[A-Za-z0-9_]+#(?=[A-Za-z_])/; // the type before the name of an enumeration's value
const LEAST_PRESS_MS = 300; // so that a slow task sees a short press
const DRAG_MS = 100; // between two values of a slider that is moved

const CONTROLS = ["button", "slider", "setpoint", "alarms"];
const SEVERAL = ["trend", "list", "picture", "alarms"];
const MAKE = {
  value: makeValue, bar: makeBar, lamp: makeLamp, button: makeButton, slider: makeSlider, setpoint: makeSetpoint,
  trend: makeTrend, list: makeList, picture: makePicture, alarms: makeAlarms,
};

// Returns an element. `operate(number, text)` returns a promise; its error is a sentence for the operator.
export function makeElement(description, number, operate) {
  const node = element("section", `element is-${description.kind}`);
  node.style.setProperty("--width", description.width);
  node.classList.toggle("wide", description.width > 1);
  node.dataset.number = number;
  const title = element("h2", "", description.text || description.items[0]?.variable || "");
  title.hidden = description.kind === "button" || (!description.text && SEVERAL.includes(description.kind));
  node.append(title);
  const error = element("p", "error");
  error.setAttribute("role", "alert");
  const send = (text) => operate(number, text).then(() => setText(error, ""), (reason) => setText(error, reason.message));
  const { content, update, showAlarms } = MAKE[description.kind]({ ...description, number }, send);
  node.append(...content);
  if (CONTROLS.includes(description.kind)) node.append(error);
  for (const control of node.querySelectorAll("button, input, select")) {
    control.disabled = !description.operates;
    if (control.tagName !== "BUTTON") control.setAttribute("aria-label", title.textContent);
  }
  return { node, update, showAlarms };
}

// ---- values ----

// Returns the text of a value as an operator reads it.
function readable(item, [text, , number]) {
  const bare = plain(text);
  const word = item.words.find(([value]) => value === bare);
  if (word) return word[1];
  const isNumber = number !== null && bare !== "TRUE" && bare !== "FALSE";
  return item.decimals !== null && isNumber ? number.toFixed(item.decimals) : bare;
}

function plain(text) {
  const quoted = /^['"](.*)['"]$/s.exec(text);
  return quoted ? quoted[1] : text.replace(UNQUOTED, "");
}

// Returns the colour of a value, "" without one.
function colourOf(item, [text, , number]) {
  const meets = {
    is: (wanted) => (typeof wanted === "number" ? number === wanted : plain(text) === wanted),
    below: (wanted) => number !== null && number < wanted,
    above: (wanted) => number !== null && number > wanted,
  };
  return item.colours.find((rule) => meets[rule.condition](rule.value))?.colour ?? "";
}

function paint(node, colour) {
  if (colour) node.dataset.colour = colour;
  else delete node.dataset.colour;
}

// Returns the parts that show a value with its unit.
function reading(item) {
  const text = element("span", "text", "–");
  const node = element("p", "reading", text);
  if (item.unit) node.append(element("span", "unit", item.unit));
  const update = (value) => {
    const [, forced, , error] = value;
    setText(text, error || readable(item, value));
    node.classList.toggle("failed", Boolean(error));
    node.classList.toggle("is-forced", forced);
    node.title = forced ? "forced" : "";
    paint(node, error ? "" : colourOf(item, value));
  };
  return { node, update };
}

// Returns a lamp: lit in a colour of the item, or green while its BOOL is TRUE.
function lampOf(item) {
  const node = element("span", "bulb");
  node.role = "img";
  const update = (value) => {
    const colour = item.colours.length ? colourOf(item, value) : value[0] === "TRUE" ? "green" : "";
    paint(node, value[3] ? "" : colour);
    node.classList.toggle("failed", Boolean(value[3]));
    node.title = value[3] || readable(item, value);
    node.ariaLabel = node.title;
  };
  return { node, update };
}

const of = (item, update) => (values) => {
  if (item.variable in values) update(values[item.variable]);
};

// ---- kinds ----

function makeValue({ items: [item] }) {
  const shown = reading(item);
  return { content: [shown.node], update: of(item, shown.update) };
}

function makeBar({ items: [item], low, high }) {
  const shown = reading(item);
  const fill = element("div", "fill");
  const track = element("div", "track", fill);
  const ends = element("p", "ends", element("span", "", low), element("span", "", high));
  const update = (value) => {
    shown.update(value);
    const share = value[2] === null ? 0 : (value[2] - low) / (high - low);
    fill.style.width = `${100 * Math.min(1, Math.max(0, share))}%`;
    paint(fill, colourOf(item, value));
  };
  return { content: [shown.node, track, ends], update: of(item, update) };
}

function makeLamp({ items: [item] }) {
  const lamp = lampOf(item);
  const word = element("span", "word");
  const update = (value) => {
    lamp.update(value);
    setText(word, value[3] || (item.words.length ? readable(item, value) : ""));
  };
  return { content: [element("p", "lit", lamp.node, word)], update: of(item, update) };
}

function makeButton({ items: [item], mode, value, text }, send) {
  const button = element("button", "operate", text || item.variable);
  button.type = "button";
  let current = "";
  if (mode === "press") pressed(button, send);
  if (mode === "toggle") button.onclick = () => send(current === "TRUE" ? "FALSE" : "TRUE");
  if (mode === "set") button.onclick = () => send(value);
  const update = (read) => {
    current = read[0];
    button.ariaPressed = mode === "set" ? plain(read[0]) === plain(value) : read[0] === "TRUE";
    button.title = read[3] || readable(item, read);
    paint(button, colourOf(item, read));
  };
  return { content: [button], update: of(item, update) };
}

// Sends TRUE while a button is held by pointer or key, FALSE as soon as it is not.
function pressed(button, send) {
  let since = null;
  const down = () => {
    if (since !== null || button.disabled) return;
    since = performance.now();
    send("TRUE");
  };
  const up = () => {
    if (since === null) return;
    const left = LEAST_PRESS_MS - (performance.now() - since);
    since = null;
    setTimeout(() => { if (since === null) send("FALSE"); }, Math.max(0, left));
  };
  const isKey = (event) => event.key === " " || event.key === "Enter";
  button.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    button.setPointerCapture(event.pointerId);
    down();
  });
  for (const end of ["pointerup", "pointercancel", "lostpointercapture", "blur"]) button.addEventListener(end, up);
  button.addEventListener("contextmenu", (event) => event.preventDefault()); // a long touch
  button.addEventListener("keydown", (event) => { if (isKey(event) && !event.repeat) down(); });
  button.addEventListener("keyup", (event) => { if (isKey(event)) up(); });
  window.addEventListener("blur", up);
  document.addEventListener("visibilitychange", () => { if (document.hidden) up(); });
}

function makeSlider({ items: [item], low, high, step }, send) {
  const shown = reading(item);
  const input = element("input");
  const last = { moved: 0, timer: 0 };
  Object.assign(input, { type: "range", min: low, max: high, step: step ?? "any" });
  const sent = () => {
    last.moved = performance.now();
    send(input.value);
  };
  input.oninput = () => {
    clearTimeout(last.timer);
    last.timer = setTimeout(sent, Math.max(0, DRAG_MS - (performance.now() - last.moved)));
  };
  const update = (value) => {
    shown.update(value);
    if (value[2] !== null && !input.matches(":active")) input.value = value[2];
  };
  return { content: [shown.node, input], update: of(item, update) };
}

function makeSetpoint({ items: [item], low, high, step, choices }, send) {
  const shown = reading(item);
  const field = choices.length ? choiceOf(choices, item) : element("input");
  if (!choices.length) {
    const limited = low !== null || high !== null;
    const type = limited || item.decimals !== null || step !== null ? "number" : "text";
    Object.assign(field, { type, step: step ?? "any", autocomplete: "off", spellcheck: false });
    if (low !== null) field.min = low;
    if (high !== null) field.max = high;
  }
  const button = element("button", "primary", "Set");
  const form = element("form", "entry", field, button);
  form.noValidate = true; // plctool says what is wrong
  let dirty = false;
  field.oninput = () => { dirty = true; };
  form.onsubmit = (event) => {
    event.preventDefault();
    dirty = false;
    send(field.value);
  };
  const update = (value) => {
    shown.update(value);
    if (!dirty && document.activeElement !== field) field.value = choices.length ? plain(value[0]) : readable({ ...item, words: [] }, value);
  };
  return { content: [shown.node, form], update: of(item, update) };
}

function choiceOf(choices, item) {
  const word = (name) => item.words.find(([value]) => value === name)?.[1] ?? name;
  const options = choices.map((name) => Object.assign(element("option", "", word(name)), { value: name }));
  return element("select", "", ...options);
}

function makeTrend({ items, seconds }) {
  const canvas = element("canvas", "plot");
  canvas.setAttribute("aria-hidden", "true");
  const legend = element("ul", "legend");
  const plot = new Plot(canvas, legend, null, seconds);
  for (const item of items) plot.toggle(item.variable, item.text, (value) => `${readable(item, value)} ${item.unit}`.trim());
  new ResizeObserver(() => plot.draw()).observe(canvas); // it has no width before it is on the page
  return { content: [canvas, legend], update: (values) => plot.update(values) };
}

function makeList({ items, only_true: onlyTrue }) {
  const rows = items.map((item) => {
    const shown = reading(item);
    const node = element("li", "", element("span", "label", item.text || item.variable), shown.node);
    shown.node.hidden = onlyTrue;
    node.hidden = onlyTrue;
    const update = (value) => {
      shown.update(value);
      const colour = colourOf(item, value);
      paint(node, colour);
      shown.node.hidden = onlyTrue && !value[3];
      node.hidden = onlyTrue && value[0] !== "TRUE" && !value[3]; // one that cannot be read is shown
    };
    return { node, update: of(item, update) };
  });
  const empty = element("p", "none", "None");
  empty.hidden = !onlyTrue;
  const update = (values) => {
    for (const row of rows) row.update(values);
    empty.hidden = rows.some((row) => !row.node.hidden);
  };
  return { content: [element("ul", "rows-of", ...rows.map((row) => row.node)), empty], update };
}

// The alarms that are active or wait, with a button for each that waits.
function makeAlarms({ operates }, send) {
  const list = element("ul", "rows-of");
  const empty = element("p", "none", "–");
  const row = (alarm) => {
    const node = element("li", "", element("span", "label", alarm.text || alarm.name), element("span", "state-of", alarmState(alarm.state)));
    node.title = alarm.name;
    paint(node, alarm.priority === 1 ? "red" : alarm.priority === 2 ? "yellow" : "blue");
    if (operates) node.append(alarmButton(alarm, send));
    return node;
  };
  const showAlarms = (alarms) => {
    list.replaceChildren(...(alarms.message ? [] : alarms.map(row)));
    empty.hidden = list.childElementCount > 0;
    setText(empty, alarms.message || "None");
  };
  return { content: [list, empty], update: () => {}, showAlarms };
}

function makePicture({ items, text, number }) {
  const image = element("img");
  image.src = `picture/${number}`;
  const frame = element("div", "frame", image);
  const places = items.map((item) => {
    const shown = item.lamp ? lampOf(item) : reading(item);
    const node = element("div", item.lamp && !item.text ? "place bare" : "place", shown.node);
    if (item.text) node.prepend(element("span", "label", item.text));
    node.style.left = `${item.x}%`;
    node.style.top = `${item.y}%`;
    frame.append(node);
    return of(item, shown.update);
  });
  image.alt = text;
  return { content: [frame], update: (values) => places.forEach((update) => update(values)) };
}
