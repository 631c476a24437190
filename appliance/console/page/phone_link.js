// A phone's readings on their way to the box: by a WebSocket where one opens, else by POST requests. Safari refuses a
// WebSocket to a certificate that is not a public one, where it accepts the page itself.
import { request } from "./box.js";

const LEAST_MS = 9; // between two readings: the box thins what is closer
const FILL_MS = 20; // a phone that lies still gives no event: its last reading is sent again
const STILL_MS = 5000, SIGN_MS = 500; // for so long; for ever while the phone gives other signs of its motion sensors
const AT_ONCE = 4; // requests on their way: 50 readings a second where each takes 80 ms
const WAITING_BYTES = 2048; // in a WebSocket: newer readings are dropped until they are gone
const RETRY_MS = 5000, PAUSE_MS = 250, SILENT_MS = 2000;

export class PhoneLink extends EventTarget {
  // Events: "answer" (detail: lamp, linked, said), "lost" (the box has no such session any more).
  constructor(session) {
    super();
    this.session = session;
    this.taps = 0;
    this.battery = undefined;
    this.sent = this.answers = 0;
    this.turned = null;
    this.turnedAt = this.sentAt = this.signAt = this.pausedUntil = -Infinity;
    this.answeredAt = performance.now();
    this.onTheWay = 0;
    this.open();
    this.timer = setInterval(() => this.fill(), FILL_MS / 2);
  }

  // Angles of a DeviceOrientationEvent, in degrees.
  take(turned) {
    [this.turned, this.turnedAt] = [turned, performance.now()];
    this.send();
  }

  // The motion sensors are on, though the phone did not turn.
  noteSign() { this.signAt = performance.now(); }

  tap() {
    this.taps++;
    this.sentAt = -Infinity;
    this.send();
  }

  // Nothing comes from the motion sensors: the box hears only that the page is open.
  get isStill() {
    const now = performance.now();
    return !this.turned || (now - this.turnedAt >= STILL_MS && now - this.signAt >= SIGN_MS);
  }

  get isSilent() { return performance.now() - this.answeredAt > SILENT_MS; }

  get way() { return this.socket?.readyState === WebSocket.OPEN ? "WebSocket" : "HTTP"; }

  close() {
    if (this.isClosed) return;
    this.isClosed = true;
    clearInterval(this.timer);
    // Outlives the page. A beacon does so too, but some browsers send none of this page's origin with it.
    fetch("/api/phones/leave", { method: "POST", body: JSON.stringify({ session: this.session }), keepalive: true }).catch(() => {});
    this.socket?.close();
  }

  open() {
    this.openedAt = performance.now();
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/api/phones/live`);
    socket.onmessage = (event) => this.hear(JSON.parse(event.data));
    socket.onclose = (event) => {
      if (this.isClosed || socket !== this.socket) return;
      this.socket = null;
      if (event.code === 1008) this.lose();
    };
    this.socket = socket;
  }

  fill() {
    const now = performance.now();
    if (this.socket?.readyState === WebSocket.OPEN && this.isSilent && now - this.openedAt > SILENT_MS) this.giveUp();
    if (this.socket === null && now - this.openedAt > RETRY_MS) this.open();
    if (now - this.sentAt >= (this.isStill ? SIGN_MS : FILL_MS)) this.send();
  }

  // A socket whose network is gone stays open for minutes; requests find the box as soon as it is back.
  giveUp() {
    const gone = this.socket;
    this.socket = null;
    this.openedAt = performance.now();
    gone.close();
  }

  send() {
    const now = performance.now();
    if (this.isClosed || now - this.sentAt < LEAST_MS || now < this.pausedUntil) return;
    const { session, taps, battery } = this;
    const message = { session, t: now, turned: this.isStill ? undefined : this.turned, taps, battery };
    if (this.socket?.readyState === WebSocket.OPEN) {
      if (this.socket.bufferedAmount > WAITING_BYTES) return;
      this.socket.send(JSON.stringify(message));
    } else {
      if (this.onTheWay >= AT_ONCE) return;
      this.post(message);
    }
    this.sentAt = now;
    this.sent++;
  }

  async post(message) {
    this.onTheWay++;
    const answer = await request("/api/phones/reading", message, SILENT_MS);
    this.onTheWay--;
    if (this.isClosed) return;
    if (answer.status === 200) this.hear(answer.value);
    else if (answer.status === 410) this.lose();
    else this.pausedUntil = performance.now() + PAUSE_MS;
  }

  hear(answer) {
    if (this.isClosed) return;
    this.answeredAt = performance.now();
    this.answers++;
    this.dispatchEvent(new CustomEvent("answer", { detail: answer }));
  }

  lose() {
    if (this.isClosed) return;
    this.close();
    this.dispatchEvent(new Event("lost"));
  }
}
