// The box at the other end: its newest word, its frames, and commands; comes back by itself.
const SILENT_MS = 4000;
const RETRY_MS = 1000;

export class Box extends EventTarget {
  constructor() {
    super();
    this.value = null;
    this.heardAt = 0;
    this.framesWanted = this.ghostWanted = false;
    this.open();
    setInterval(() => this.check(), 500);
    document.addEventListener("visibilitychange", () => this.wake());
    addEventListener("online", () => this.wake());
    addEventListener("pageshow", () => this.wake());
  }

  open() {
    this.openedAt = performance.now();
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/watch`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => this.say();
    socket.onmessage = (event) => {
      if (socket !== this.socket) return;
      if (typeof event.data !== "string") {
        this.dispatchEvent(new CustomEvent("frame", { detail: event.data }));
        return;
      }
      const value = JSON.parse(event.data);
      if (!("verdict" in value)) return;
      this.value = value;
      this.heardAt = performance.now();
      this.dispatchEvent(new Event("value"));
    };
    socket.onclose = () => { if (socket === this.socket) this.socket = null; };
    this.socket = socket;
  }

  get isSilent() { return performance.now() - this.heardAt > SILENT_MS; }

  check() {
    const age = performance.now() - this.openedAt;
    if (this.socket === null ? age > RETRY_MS : this.isSilent && age > SILENT_MS) this.reopen();
    this.dispatchEvent(new Event("beat"));
  }

  wake() {
    if (document.visibilityState === "visible" && (this.socket === null || this.isSilent)) this.reopen();
    this.say();
  }

  reopen() {
    const before = this.socket;
    this.socket = null;
    before?.close();
    this.open();
  }

  showFrames(wanted, ghost) {
    [this.framesWanted, this.ghostWanted] = [wanted, ghost];
    this.say();
  }

  say() {
    if (this.socket?.readyState !== WebSocket.OPEN) return;
    this.socket.send(JSON.stringify({ frames: this.framesWanted && document.visibilityState === "visible", ghost: this.ghostWanted }));
  }
}

// What the box answers to a request: {status, words, done, ...}; status 0: no answer at all.
export async function request(path, said, patienceMs = 6000) {
  const options = said === undefined ? {} : { method: "POST", body: JSON.stringify(said) };
  try {
    const response = await fetch(path, { ...options, signal: AbortSignal.timeout(patienceMs) });
    if (!response.ok) return { status: response.status, words: await response.text() };
    return { status: 200, value: await response.json() };
  } catch {
    return { status: 0, words: "" };
  }
}
