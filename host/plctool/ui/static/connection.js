// The websocket to plctool: requests with replies, and news by topic. It is opened again when it was lost.

const RETRY_MS = 1000;

export class Connection {
  // `onNews(topic, content)`; `onChange(connected, reason)`.
  constructor(onNews, onChange) {
    this.onNews = onNews;
    this.onChange = onChange;
    this.waiting = new Map();
    this.lastId = 0;
    this.open();
  }

  open() {
    const address = new URL("live", document.baseURI);
    address.protocol = "ws:";
    this.socket = new WebSocket(address);
    this.socket.onopen = () => this.onChange(true, "");
    this.socket.onmessage = (event) => this.receive(JSON.parse(event.data));
    this.socket.onclose = (event) => this.lost(event.reason);
  }

  receive(message) {
    if (message.is !== "reply") return this.onNews(message.is, message.content);
    const reply = this.waiting.get(message.id);
    this.waiting.delete(message.id);
    if (!reply) return undefined;
    return message.error === undefined ? reply.resolve(message.result) : reply.reject(new Error(message.error));
  }

  lost(reason) {
    const text = reason || "plctool has ended, or this machine cannot reach it.";
    for (const reply of this.waiting.values()) reply.reject(new Error(text));
    this.waiting.clear();
    this.onChange(false, text);
    setTimeout(() => this.open(), RETRY_MS);
  }

  // Returns a promise of what plctool replies; its error is a sentence for the user.
  ask(verb, fields = {}) {
    if (this.socket.readyState !== WebSocket.OPEN) return Promise.reject(new Error("plctool is not connected."));
    const id = ++this.lastId;
    this.socket.send(JSON.stringify({ do: verb, id, ...fields }));
    return new Promise((resolve, reject) => this.waiting.set(id, { resolve, reject }));
  }
}
