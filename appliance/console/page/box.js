// The box at the other end: its newest word, its frames, and commands; comes back by itself.
const SILENT_MS = 4000;
const RETRY_MS = 1000;
const REFUSED = 2; // tries in a row, and the page asks for each word and frame instead
const WORDS_MS = 1000, FRAME_MS = 40, LATEST_MS = 2000; // a frame that takes longer is lost with its network

export class Box extends EventTarget {
  constructor() {
    super();
    this.value = null;
    this.heardAt = 0;
    this.framesWanted = this.ghostWanted = this.isPolling = false;
    this.refused = 0;
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
    let opened = false;
    socket.onopen = () => {
      [opened, this.refused] = [true, 0];
      this.say();
    };
    socket.onmessage = (event) => {
      if (socket !== this.socket) return;
      if (typeof event.data !== "string") {
        this.dispatchEvent(new CustomEvent("frame", { detail: event.data }));
        return;
      }
      this.hear(JSON.parse(event.data));
    };
    socket.onclose = () => {
      if (socket !== this.socket) return;
      this.socket = null;
      if (!opened && ++this.refused >= REFUSED) this.poll();
    };
    this.socket = socket;
  }

  hear(value) {
    if (!("verdict" in value)) return;
    this.value = value;
    this.heardAt = performance.now();
    this.dispatchEvent(new Event("value"));
  }

  // Safari refuses a WebSocket to a certificate that is not public, where it accepts the page.
  async poll() {
    if (this.isPolling) return;
    this.isPolling = true;
    while (this.refused >= REFUSED) {
      const answer = await request("/status");
      if (answer.status === 200) this.hear(answer.value);
      const until = performance.now() + WORDS_MS;
      while (performance.now() < until) {
        if (this.framesWanted && document.visibilityState === "visible") await this.pollFrame();
        await new Promise((over) => setTimeout(over, FRAME_MS));
      }
    }
    this.isPolling = false;
  }

  async pollFrame() {
    const asked = fetch(this.ghostWanted ? "/frame?ghost" : "/frame", { signal: AbortSignal.timeout(LATEST_MS) });
    const frame = await asked.then((answer) => answer.arrayBuffer()).catch(() => null);
    const tick = frame?.byteLength >= 8 ? new DataView(frame).getFloat64(0, true) : this.tick;
    if (tick === this.tick) return;
    this.tick = tick;
    this.dispatchEvent(new CustomEvent("frame", { detail: frame }));
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

// The box's answer to a request: {status, message, done, ...}; status 0: no answer.
export async function request(path, said, patienceMs = 6000) {
  const options = said === undefined ? {} : { method: "POST", body: JSON.stringify(said) };
  try {
    const response = await fetch(path, { ...options, signal: AbortSignal.timeout(patienceMs) });
    if (!response.ok) return { status: response.status, message: await response.text() };
    return { status: 200, value: await response.json() };
  } catch {
    return { status: 0, message: "" };
  }
}
