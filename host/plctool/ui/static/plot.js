// A trend of the last minute, or more: each variable in a strip of its own, since their units differ.

import { element } from "./dom.js";

const SECONDS = 60;
const STRIP = 64; // pixels
const GAP = 10;
const COLOURS = ["--plot-1", "--plot-2", "--plot-3", "--plot-4", "--plot-5", "--plot-6"];
export const MAX_PLOTTED = COLOURS.length;

export class Plot {
  // `onRemove(name)`: the user does not want to see it any more; without it variables stay. `seconds`: that are seen.
  constructor(canvas, legend, onRemove, seconds = SECONDS) {
    Object.assign(this, { canvas, legend, onRemove, seconds });
    this.series = new Map(); // name: {points: [[seconds, number]], colour, text, label, readable}
    this.frame = 0;
  }

  get names() {
    return new Set(this.series.keys());
  }

  // Adds or removes a variable. `readable(value)` returns the text of a value in the legend.
  toggle(name, label = "", readable = ([text]) => text) {
    const made = { points: [], colour: this.freeColour(), text: "", label: label || name, readable };
    if (this.series.has(name)) this.series.delete(name);
    else if (this.series.size < MAX_PLOTTED) this.series.set(name, made);
    this.showLegend();
    this.draw();
  }

  freeColour() {
    const used = new Set([...this.series.values()].map((one) => one.colour));
    return COLOURS.find((colour) => !used.has(colour));
  }

  update(values) {
    const now = performance.now() / 1000;
    for (const [name, value] of Object.entries(values)) {
      const one = this.series.get(name);
      if (!one) continue;
      one.text = value[3] || one.readable(value);
      one.value.textContent = one.text;
      if (value[2] !== null) one.points.push([now, value[2]]);
    }
  }

  showLegend() {
    this.legend.replaceChildren();
    for (const [name, one] of this.series) {
      const swatch = element("i", "swatch");
      swatch.style.background = `var(${one.colour})`;
      one.value = element("span", "value", one.text);
      const row = element("li", "", swatch, element("span", "label", one.label), one.value);
      if (this.onRemove) row.append(this.removeButton(name));
      this.legend.append(row);
    }
    if (!this.series.size) this.legend.append(element("li", "hint", "Choose numbers in the list to see their trend."));
  }

  removeButton(name) {
    const remove = element("button", "quiet", "×");
    remove.setAttribute("aria-label", `Remove ${name} from the trend`);
    remove.onclick = () => this.onRemove(name);
    return remove;
  }

  // Draws, and again with each frame while there is something to see.
  draw() {
    cancelAnimationFrame(this.frame);
    const width = this.canvas.clientWidth;
    const height = this.series.size * (STRIP + GAP) + 16;
    const ratio = window.devicePixelRatio || 1;
    this.canvas.hidden = !this.series.size;
    this.canvas.style.height = `${height}px`;
    this.canvas.width = width * ratio;
    this.canvas.height = height * ratio;
    const pen = this.canvas.getContext("2d");
    pen.scale(ratio, ratio);
    const colours = getComputedStyle(this.canvas);
    const now = performance.now() / 1000;
    this.grid(pen, width, height, colours);
    let top = 0;
    for (const one of this.series.values()) {
      this.strip(pen, one, now, width, top, colours);
      top += STRIP + GAP;
    }
    if (this.series.size && width) this.frame = requestAnimationFrame(() => this.draw());
  }

  grid(pen, width, height, colours) {
    pen.strokeStyle = colours.getPropertyValue("--line");
    pen.fillStyle = colours.getPropertyValue("--dim");
    pen.font = "11px system-ui, sans-serif";
    for (let quarter = 0; quarter <= 4; quarter++) {
      const seconds = (this.seconds * quarter) / 4;
      const x = Math.round(width * (1 - quarter / 4)) + (quarter === 4 ? 0.5 : -0.5);
      pen.beginPath();
      pen.moveTo(x, 0);
      pen.lineTo(x, height - 16);
      pen.stroke();
      pen.textAlign = quarter === 0 ? "right" : quarter === 4 ? "left" : "center";
      pen.fillText(seconds ? `−${seconds} s` : "now", x, height - 3);
    }
  }

  strip(pen, one, now, width, top, colours) {
    const begin = now - this.seconds;
    while (one.points.length > 1 && one.points[1][0] < begin) one.points.shift();
    const numbers = one.points.map((point) => point[1]);
    if (!numbers.length) return;
    const [low, high] = scale(Math.min(...numbers), Math.max(...numbers));
    const y = (number) => top + 4 + (STRIP - 8) * (1 - (number - low) / (high - low));
    const x = (seconds) => Math.max(0, (width * (seconds - begin)) / this.seconds);
    pen.strokeStyle = colours.getPropertyValue(one.colour);
    pen.lineWidth = 1.75;
    pen.lineJoin = "round";
    pen.beginPath();
    pen.moveTo(x(one.points[0][0]), y(numbers[0]));
    one.points.forEach(([seconds, number], i) => {
      if (i) pen.lineTo(x(seconds), y(numbers[i - 1])); // a value lasts until the next one
      pen.lineTo(x(seconds), y(number));
    });
    pen.lineTo(width, y(numbers.at(-1)));
    pen.stroke();
    pen.lineWidth = 1;
    pen.fillStyle = colours.getPropertyValue("--dim");
    pen.textAlign = "left";
    pen.fillText(short(high), 4, top + 12);
    pen.fillText(short(low), 4, top + STRIP - 2);
  }
}

// Returns the ends of an axis: noise of a value that hardly changes is not made large.
function scale(low, high) {
  const least = Math.max(Math.abs(low), Math.abs(high)) / 100 || 1;
  if (high - low >= least) return [low, high];
  if (low === high && (low === 0 || low === 1)) return [0, 1]; // as a BOOL is drawn when it changes
  const middle = (low + high) / 2;
  return [middle - least / 2, middle + least / 2];
}

const short = (number) => String(Number(number.toPrecision(5)));
