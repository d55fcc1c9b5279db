// The diagrams of the program with the values of their pins, contacts, coils and steps.

import { element, setText } from "./dom.js";

export class Diagrams {
  // `onShown()`: other variables are shown.
  constructor(node, connection, onShown) {
    this.select = node.querySelector("select");
    this.place = node.querySelector(".scroll");
    this.connection = connection;
    this.onShown = onShown;
    this.select.onchange = () => this.show(this.select.value);
    this.forget();
  }

  forget() {
    this.listed = false;
    this.names = [];
    this.cells = new Map(); // name of a variable: elements that show it
  }

  // Lists the diagrams and shows the first, unless that is done.
  async load() {
    if (this.listed) return;
    this.listed = true;
    try {
      const found = await this.connection.ask("diagrams");
      this.select.replaceChildren(...found.map((one) => {
        const option = element("option", "", `${one.name} (${one.pou}, ${one.language})`);
        option.value = one.name;
        return option;
      }));
      this.select.hidden = !found.length;
      if (found.length) await this.show(found[0].name);
      else this.say("The sources beside this page have no diagrams.");
    } catch (error) {
      this.listed = false;
      this.say(error.message);
    }
  }

  say(text) {
    this.place.replaceChildren(element("p", "empty", text));
  }

  async show(name) {
    try {
      const { svg, names } = await this.connection.ask("diagram", { name });
      const drawn = document.importNode(new DOMParser().parseFromString(svg, "image/svg+xml").documentElement, true);
      this.names = names;
      this.cells = new Map();
      for (const cell of drawn.querySelectorAll("[data-variable]")) {
        const variable = cell.dataset.variable;
        this.cells.set(variable, [...(this.cells.get(variable) ?? []), cell]);
      }
      this.place.replaceChildren(drawn);
      this.onShown();
    } catch (error) {
      this.say(error.message);
    }
  }

  update(values) {
    for (const [name, [text, forced]] of Object.entries(values)) {
      for (const cell of this.cells.get(name) ?? []) {
        cell.classList.toggle("on", text === "TRUE");
        if (!cell.classList.contains("step")) setText(cell, forced ? `${text} (forced)` : text);
      }
    }
  }
}
