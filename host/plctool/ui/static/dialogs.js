// The dialog that writes and forces a variable, and the one that asks before the program starts or stops.

import { byId, setText } from "./dom.js";

const UNQUOTED = /^[A-Za-z0-9_]+#(?=[A-Za-z_])/; // the type before the name of an enumeration's value

export class EditDialog {
  constructor(connection) {
    this.connection = connection;
    this.dialog = byId("edit");
    this.text = byId("edit-text");
    this.dialog.querySelector("form").onsubmit = (event) => this.send(event, "write");
    byId("edit-force").onclick = (event) => this.send(event, "force");
    byId("edit-unforce").onclick = (event) => this.send(event, "unforce");
    byId("edit-cancel").onclick = () => this.dialog.close();
    for (const choice of byId("edit-bool").children) choice.onclick = () => this.choose(choice.value);
  }

  open(row, [text = "", forced = false]) {
    this.row = row;
    setText(byId("edit-name"), row.name);
    setText(byId("edit-type"), forced ? `${row.type}, forced` : row.type);
    setText(byId("edit-error"), "");
    byId("edit-choices").replaceChildren(...row.choices.map((name) => Object.assign(document.createElement("option"), { value: name })));
    const isBool = row.type === "BOOL";
    byId("edit-bool").hidden = !isBool;
    this.text.hidden = isBool;
    byId("edit-force").hidden = !row.force;
    byId("edit-unforce").hidden = !forced;
    this.choose(row.choices.length ? text.replace(UNQUOTED, "") : text);
    this.dialog.showModal();
    if (!isBool) this.text.select();
  }

  choose(text) {
    this.text.value = text;
    for (const choice of byId("edit-bool").children) choice.ariaPressed = choice.value === text;
  }

  async send(event, verb) {
    event.preventDefault();
    const fields = verb === "unforce" ? { name: this.row.name } : { name: this.row.name, text: this.text.value };
    try {
      await this.connection.ask(verb, fields);
      this.dialog.close();
    } catch (error) {
      setText(byId("edit-error"), error.message);
    }
  }
}

export class AskDialog {
  constructor() {
    this.dialog = byId("ask");
    this.dialog.querySelector("form").onsubmit = (event) => this.yes(event);
    byId("ask-no").onclick = () => this.dialog.close();
  }

  // Asks a question; `action` returns a promise, and is called if the user agrees.
  open(question, answer, action) {
    this.action = action;
    setText(byId("ask-text"), question);
    setText(byId("ask-yes"), answer);
    setText(byId("ask-error"), "");
    this.dialog.showModal();
  }

  async yes(event) {
    event.preventDefault();
    try {
      await this.action();
      this.dialog.close();
    } catch (error) {
      setText(byId("ask-error"), error.message);
    }
  }
}
