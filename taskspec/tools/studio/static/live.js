// Questions to the server over a websocket: one answer each, and of each kind only the newest counts.

export class Live {
  /** Connect to an address; `closed` is called when the connection has ended. */
  constructor(address, closed) {
    this.last = 0;
    this.newest = {};
    this.waiting = new Map();
    this.socket = new WebSocket(address);
    this.socket.addEventListener("message", ({ data }) => this.answered(JSON.parse(data)));
    this.socket.addEventListener("close", closed);
    this.opened = new Promise((resolve) => this.socket.addEventListener("open", resolve));
  }

  /** Return the answer to a question; it is `outdated` where a newer one of its kind was asked meanwhile. */
  async ask(kind, fields = {}) {
    const id = ++this.last;
    this.newest[kind] = id;
    await this.opened;
    this.socket.send(JSON.stringify({ id, kind, ...fields }));
    return new Promise((resolve) => this.waiting.set(id, resolve));
  }

  answered(answer) {
    const isOld = answer.id !== this.newest[answer.kind];
    this.waiting.get(answer.id)?.({ ...answer, outdated: answer.outdated || isOld });
    this.waiting.delete(answer.id);
  }
}
