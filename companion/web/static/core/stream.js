// The stream of states from the server. Reconnects after growing waits for as long as the page is open.

const FIRST_WAIT_S = 0.5;
const LONGEST_WAIT_S = 5;
const GROWTH = 1.7;
const SILENCE_S = 6; // a socket silent for longer is dead, even if the browser calls it open

const now_s = () => performance.now() / 1000;

export class Stream {
  /** Calls `onFrame(text)` for each frame, `onOpen()` on each connection; `expecting()` is false while none are due. */
  constructor(url, { onFrame, onOpen, expecting }) {
    Object.assign(this, { url, onFrame, onOpen, expecting });
    this.socket = null;
    this.wait_s = FIRST_WAIT_S;
    this.retryAt_s = null;
    this.heardAt_s = now_s();
    this.startedAt_s = now_s();
    setInterval(() => this.watch(), 250);
    // Timers sleep in a hidden page: reconnect at once when it is shown again.
    document.addEventListener("visibilitychange", () => this.hurry());
    window.addEventListener("online", () => this.hurry());
    this.connect();
  }

  get open() {
    return this.socket !== null && this.socket.readyState === WebSocket.OPEN;
  }

  /** Time since the last frame [s]. */
  get silent_s() {
    return now_s() - this.heardAt_s;
  }

  /** Time until the next attempt [s]; null while one is under way. */
  get retryIn_s() {
    return this.retryAt_s === null ? null : Math.max(0, this.retryAt_s - now_s());
  }

  connect() {
    this.retryAt_s = null;
    this.startedAt_s = now_s();
    const socket = new WebSocket(this.url);
    this.socket = socket;
    socket.onopen = () => this.onOpen();
    socket.onmessage = (event) => this.heard(event.data);
    socket.onclose = () => this.lost(socket);
  }

  heard(text) {
    this.heardAt_s = now_s();
    this.wait_s = FIRST_WAIT_S;
    if (typeof text === "string") this.onFrame(text);
  }

  lost(socket) {
    if (socket !== this.socket) return;
    this.socket = null;
    // Random, so that many pages that lost one server do not all return in the same instant.
    this.retryAt_s = now_s() + this.wait_s * (0.8 + 0.2 * Math.random());
    this.wait_s = Math.min(LONGEST_WAIT_S, this.wait_s * GROWTH);
  }

  watch() {
    if (this.socket === null) {
      if (this.retryAt_s !== null && now_s() >= this.retryAt_s) this.connect();
      return;
    }
    const quiet_s = Math.min(this.silent_s, now_s() - this.startedAt_s);
    if (quiet_s > SILENCE_S && (!this.open || this.expecting())) this.drop();
  }

  drop() {
    const socket = this.socket;
    socket.onopen = socket.onmessage = socket.onclose = null;
    socket.close(); // not awaited: it takes long when the other end is gone
    this.lost(socket);
  }

  hurry() {
    if (this.socket === null && !document.hidden) this.connect();
  }

  send(message) {
    if (this.open) this.socket.send(JSON.stringify(message));
  }
}
