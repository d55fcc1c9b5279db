// The tree of variables. Only the rows that are seen are elements, and only their values are asked for.

import { element, setText } from "./dom.js";

const SPARE = 4; // rows above and below the visible ones
const INDENT = 18; // pixels of a level
const CHANGED_MS = 600;

class Item {
  constructor(row, level, parent) {
    Object.assign(this, row);
    this.level = level;
    this.parent = parent;
    this.children = null;
    this.open = false;
  }
}

export class Tree {
  // `load(path, start)` and `search(text)` return promises of rows; `on`: edit(row, value), plot(row), shown().
  constructor(box, { load, search, on }) {
    this.box = box;
    this.rows = box.querySelector(".rows");
    this.empty = box.querySelector(".empty");
    Object.assign(this, { load, searchFor: search, on });
    this.values = new Map();
    this.plotted = new Set();
    this.drawn = new Map();
    this.items = [];
    this.current = 0;
    this.roots = [];
    this.text = "";
    this.searches = 0;
    box.addEventListener("scroll", () => this.draw());
    box.addEventListener("keydown", (event) => this.key(event));
    box.addEventListener("click", (event) => this.click(event));
    new ResizeObserver(() => this.draw()).observe(box);
  }

  // Shows another program. What was open opens again if it is there.
  async reload() {
    const open = new Set(this.items.filter((item) => item.open).map((item) => item.name));
    this.values.clear();
    this.roots = await this.fetch("", null);
    await this.reopen(this.roots, open);
    if (this.roots.length === 1 && !open.size) await this.toggle(this.roots[0]);
    if (this.text) return this.search(this.text);
    return this.flatten(this.roots);
  }

  async reopen(items, open) {
    for (const item of items) {
      if (!item.opens || !open.has(item.name)) continue;
      item.children = await this.fetch(item.name, item);
      item.open = true;
      await this.reopen(item.children, open);
    }
  }

  clear(message) {
    this.roots = [];
    this.flatten([], message);
  }

  async fetch(path, parent, start = 0) {
    const level = parent ? parent.level + 1 : 0;
    const found = await this.load(path, start);
    const items = found.rows.map((row) => new Item(row, level, parent));
    if (found.more) {
      const next = start + found.rows.length;
      items.push(new Item({ name: `${path}\n${next}`, label: "Show more", more: { path, next } }, level, parent));
    }
    return items;
  }

  async search(text) {
    this.text = text.trim();
    const search = ++this.searches;
    if (!this.text) return this.flatten(this.roots);
    const found = await this.searchFor(this.text);
    if (search !== this.searches) return undefined; // a newer one was typed
    const items = found.rows.map((row) => new Item(row, 0, null));
    const more = found.more ? "More variables match; type more of the name." : "";
    return this.flatten(items, items.length ? more : `No variable has “${this.text}” in its name.`);
  }

  flatten(tops, message = "") {
    this.tops = tops;
    this.items = [];
    const add = (item) => {
      this.items.push(item);
      if (item.open) item.children.forEach(add);
    };
    tops.forEach(add);
    this.empty.hidden = !message;
    setText(this.empty, message);
    this.current = Math.min(this.current, Math.max(0, this.items.length - 1));
    for (const row of this.drawn.values()) row.remove();
    this.drawn.clear();
    this.draw();
  }

  async toggle(item) {
    if (item.more) return this.showMore(item);
    if (!item.opens) return undefined;
    if (!item.children) item.children = await this.fetch(item.name, item);
    item.open = !item.open;
    return this.flatten(this.tops ?? this.roots);
  }

  async showMore(item) {
    const siblings = item.parent ? item.parent.children : this.tops;
    const more = await this.fetch(item.more.path, item.parent, item.more.next);
    siblings.splice(siblings.indexOf(item), 1, ...more);
    this.flatten(this.tops);
  }

  // ---- rows ----

  get height() {
    return parseInt(getComputedStyle(this.box).getPropertyValue("--row"), 10);
  }

  draw() {
    const height = this.height;
    const first = Math.max(0, Math.floor(this.box.scrollTop / height) - SPARE);
    const end = Math.min(this.items.length, Math.ceil((this.box.scrollTop + this.box.clientHeight) / height) + SPARE);
    this.rows.style.height = `${this.items.length * height}px`;
    const shown = new Map();
    for (let i = first; i < end; i++) shown.set(i, this.drawn.get(i) ?? this.makeRow(this.items[i], i));
    for (const [i, row] of this.drawn) if (!shown.has(i)) row.remove();
    this.drawn = shown;
    for (const [i, row] of shown) {
      row.style.transform = `translateY(${i * height}px)`;
      if (!row.parentNode) this.rows.append(row);
    }
    this.mark();
    this.on.shown();
  }

  makeRow(item, index) {
    const row = element("div", "row");
    row.id = `row-${index}`;
    row.role = "treeitem";
    row.dataset.index = index;
    row.ariaLevel = item.level + 1;
    if (item.opens) row.ariaExpanded = item.open;
    const twisty = element("span", item.opens ? "twisty" : "twisty none");
    twisty.style.marginInlineStart = `${item.level * INDENT}px`;
    const label = element("span", item.more ? "label link" : "label", item.label);
    label.title = item.more ? "" : item.name;
    row.append(twisty, label, element("span", "type", item.type ?? ""));
    const force = element("span", "mark", "forced");
    force.hidden = true;
    const value = element(item.write ? "button" : "span", "value");
    if (item.write) Object.assign(value, { type: "button", tabIndex: -1, title: "Write or force" });
    const plot = element("button", "plot", "");
    Object.assign(plot, { type: "button", tabIndex: -1, title: "Show in the trend", hidden: !item.plot });
    plot.setAttribute("aria-label", "Show in the trend");
    row.append(force, value, plot);
    this.fill(row, item);
    return row;
  }

  fill(row, item) {
    const [text = "", forced = false, , error = ""] = this.values.get(item.name) ?? [];
    const value = row.querySelector(".value");
    setText(value, error || text);
    value.classList.toggle("failed", Boolean(error));
    value.classList.toggle("on", text === "TRUE");
    value.hidden = !item.value;
    row.querySelector(".mark").hidden = !forced;
    row.classList.toggle("is-forced", forced);
    row.querySelector(".plot").classList.toggle("on", this.plotted.has(item.name));
  }

  // Takes new values by name.
  update(values) {
    for (const [name, value] of Object.entries(values)) this.values.set(name, value);
    for (const [i, row] of this.drawn) {
      const item = this.items[i];
      if (!(item.name in values)) continue;
      const before = row.querySelector(".value").textContent;
      this.fill(row, item);
      if (before && before !== row.querySelector(".value").textContent) this.flash(row);
    }
  }

  flash(row) {
    row.classList.add("changed");
    clearTimeout(row.timer);
    row.timer = setTimeout(() => row.classList.remove("changed"), CHANGED_MS);
  }

  setPlotted(names) {
    this.plotted = names;
    for (const [i, row] of this.drawn) this.fill(row, this.items[i]);
  }

  // The names whose values are seen.
  get shownNames() {
    return [...this.drawn.keys()].map((i) => this.items[i]).filter((item) => item?.value).map((item) => item.name);
  }

  // ---- keys and clicks ----

  mark() {
    for (const [i, row] of this.drawn) row.ariaSelected = i === this.current;
    const there = this.drawn.has(this.current);
    if (there) this.box.setAttribute("aria-activedescendant", `row-${this.current}`);
    else this.box.removeAttribute("aria-activedescendant");
  }

  select(index) {
    this.current = Math.max(0, Math.min(index, this.items.length - 1));
    const height = this.height;
    const top = this.current * height;
    if (top < this.box.scrollTop) this.box.scrollTop = top;
    const bottom = top + height - this.box.clientHeight;
    if (bottom > this.box.scrollTop) this.box.scrollTop = bottom;
    this.draw();
  }

  click(event) {
    const row = event.target.closest(".row");
    if (!row) return;
    const index = Number(row.dataset.index);
    const item = this.items[index];
    this.select(index);
    if (event.target.closest(".plot")) this.on.plot(item);
    else if (event.target.closest(".value") && item.write) this.edit(item);
    else this.toggle(item);
  }

  edit(item) {
    this.on.edit(item, this.values.get(item.name) ?? []);
  }

  key(event) {
    const item = this.items[this.current];
    if (!item || event.ctrlKey || event.metaKey || event.altKey) return;
    const page = Math.max(1, Math.floor(this.box.clientHeight / this.height) - 1);
    const moves = { ArrowDown: 1, ArrowUp: -1, PageDown: page, PageUp: -page, Home: -Infinity, End: Infinity };
    if (event.key in moves) this.select(this.current + moves[event.key]);
    else if (event.key === "ArrowRight") this.right(item);
    else if (event.key === "ArrowLeft") this.left(item);
    else if (event.key === "Enter") (item.write ? this.edit(item) : this.toggle(item));
    else if (event.key === " ") (item.plot ? this.on.plot(item) : this.toggle(item));
    else return;
    event.preventDefault();
  }

  right(item) {
    if (item.open) this.select(this.current + 1);
    else this.toggle(item);
  }

  left(item) {
    if (item.open) this.toggle(item);
    else if (item.parent) this.select(this.items.indexOf(item.parent));
  }
}
