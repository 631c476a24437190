// The figure of a rehearsal: a finger or the mouse takes a joint by its ring, and that is the hand. A round ring
// turns its joint; a square one takes it to a place, in the plane that faced the eye when it was taken.
import { Dance } from "./dance.js";
import { say, withPin } from "./device.js";
import { aimed, inverse, multiplied } from "./rotation.js";

const TOUCH_PX = 40; // from the middle of a ring
const EVERY_MS = 50; // between two messages; the box gives a joint back after half a second of silence
const RETRY_MS = 1000;
const FREE = "#6cb4ee", HELD = "#ff8a5c", STRING = "#f3ece0";

export class Figure extends Dance {
  constructor(canvas, caption, box, words) {
    super(canvas, caption, box, words);
    this.taken = new Map(); // by pointer: which joint, where the finger is, how the joint was
    this.socket = null;
    this.openedAt = -RETRY_MS;
    setInterval(() => this.stream(), EVERY_MS);
    document.addEventListener("visibilitychange", () => { if (document.hidden) this.letGo(); });
    document.addEventListener("freeze", () => this.letGo());
    addEventListener("pagehide", () => this.letGo());
  }

  // Joints that a hand by OSC holds: the page is such a desk.
  get joints() {
    if (!this.show) return [];
    const names = this.show.held.filter((_, place) => this.show.hands[place] === "osc"); // twice: also by position
    return [...new Set(names)].map((name) => this.show.joints.indexOf(name));
  }

  isPlaced(joint) {
    const { by_position, hands, held, joints } = this.show;
    return by_position.some((hand) => hands[hand] === "osc" && held[hand] === joints[joint]);
  }

  turnBy(canvas) {
    canvas.addEventListener("pointerdown", (event) => {
      const joint = this.ringAt(this.pixel(event));
      if (joint === null) return;
      event.stopImmediatePropagation(); // a finger that holds does not turn the view
      event.preventDefault();
      if (document.body.dataset.known !== "yes") {
        withPin(() => this.open());
        return;
      }
      canvas.setPointerCapture(event.pointerId);
      this.hold(joint, event);
    });
    canvas.addEventListener("pointermove", (event) => {
      const hold = this.taken.get(event.pointerId);
      if (!hold) return;
      hold.at = this.pixel(event);
      this.redraw();
    });
    for (const kind of ["pointerup", "pointercancel", "lostpointercapture"]) {
      canvas.addEventListener(kind, (event) => this.release(event.pointerId));
    }
    super.turnBy(canvas);
  }

  hold(joint, event) {
    const tip = this.tip(joint), from = this.point(joint), way = tip.map((value, axis) => value - from[axis]);
    if (this.holding(joint)) return;
    this.open();
    this.taken.set(event.pointerId, {
      joint, at: this.pixel(event), way, length: Math.hypot(...way), world: [...this.turned(joint)], away: this.view(way)[2], from: [...from],
    });
    this.stream();
  }

  release(pointer) {
    const hold = this.taken.get(pointer);
    if (!hold) return;
    this.taken.delete(pointer);
    this.tellBox({ joint: this.show.joints[hold.joint] });
  }

  letGo() {
    for (const pointer of [...this.taken.keys()]) this.release(pointer);
    this.socket?.close();
    this.socket = null;
  }

  holding(joint) { return [...this.taken.values()].some((hold) => hold.joint === joint); }

  open() {
    if (this.socket?.readyState <= WebSocket.OPEN || performance.now() - this.openedAt < RETRY_MS) return;
    this.openedAt = performance.now();
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/hands`);
    socket.onmessage = (event) => say(JSON.parse(event.data).refused, true);
    socket.onclose = () => { if (socket === this.socket && this.taken.size) say(this.words("hand_lost"), true); };
    this.socket = socket;
  }

  tellBox(said) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(said));
  }

  // Where the fingers are in the newest frame: places, or orientations local to the parent joint.
  stream() {
    if (!this.frame || !this.show || this.taken.size === 0) return;
    this.open();
    for (const { joint, at, way, length, world, away, from } of this.taken.values()) {
      if (this.isPlaced(joint)) {
        this.tellBox({ joint: this.show.joints[joint], at: this.place(from, at).map((value) => Number(value.toFixed(4))) });
        continue;
      }
      const parent = this.show.parents[joint];
      const turned = multiplied(aimed(way, this.pointing(joint, at, length, away)), world);
      const local = parent < 0 ? turned : multiplied(inverse(this.turned(parent)), turned);
      this.tellBox({ joint: this.show.joints[joint], turned: local.map((value) => Number(value.toFixed(5))) });
    }
  }

  // From the joint to the finger; the bone keeps its length, so a finger nearer to the joint turns it away.
  pointing(joint, at, length, away) {
    let [side, up] = this.apart(this.point(joint), at);
    const far = Math.hypot(side, up);
    if (far > length) [side, up] = [side * length / far, up * length / far];
    return this.world(side, up, Math.sign(away || 1) * Math.sqrt(Math.max(0, length ** 2 - side ** 2 - up ** 2)));
  }

  // The place in the room under a pixel, as far from the eye as a point is.
  place(from, at) { return this.world(...this.apart(from, at), 0).map((value, axis) => value + from[axis]); }

  // How far a pixel is from a point, in metres at its distance: to the right, up.
  apart(point, at) {
    const ratio = this.canvas.width / this.canvas.clientWidth;
    const middle = this.eye(this.canvas.width, this.canvas.height)(point);
    return [(at[0] * ratio - middle.x) / middle.scale, (middle.y - at[1] * ratio) / middle.scale];
  }

  // A way in metres that the eye sees (to the right, up, towards the eye), in the room.
  world(side, up, near) {
    const [sy, cy, sp, cp] = [Math.sin(this.yaw), Math.cos(this.yaw), Math.sin(this.pitch), Math.cos(this.pitch)];
    return [side * cy - up * sp * sy + near * cp * sy, up * cp + near * sp, -side * sy - up * sp * cy + near * cp * cy];
  }

  // A way in metres as the eye sees it: to the right, up, towards the eye.
  view([x, y, z]) {
    const [sy, cy, sp, cp] = [Math.sin(this.yaw), Math.cos(this.yaw), Math.sin(this.pitch), Math.cos(this.pitch)];
    const near = sy * x + cy * z;
    return [cy * x - sy * z, cp * y - sp * near, cp * near + sp * y];
  }

  pixel(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  point(joint) { return this.frame.positions.subarray(3 * joint, 3 * joint + 3); }

  turned(joint) { return this.frame.world.subarray(4 * joint, 4 * joint + 4); }

  // The end of the bone that a joint turns: there is its ring.
  tip(joint) {
    const below = this.show.parents.flatMap((parent, child) => parent === joint ? [child] : []);
    if (below.length === 0) {
      const bone = this.bones(this.frame).find((one) => one.joint === joint);
      return bone ? bone.to : [...this.point(joint)].map((value, axis) => value + (axis === 1 ? 0.1 : 0));
    }
    const sum = below.map((child) => this.point(child)).reduce((all, one) => all.map((value, axis) => value + one[axis]), [0, 0, 0]);
    return sum.map((value) => value / below.length);
  }

  ring(joint) {
    const ratio = this.canvas.width / this.canvas.clientWidth;
    const at = this.eye(this.canvas.width, this.canvas.height)(this.isPlaced(joint) ? this.point(joint) : this.tip(joint));
    return [at.x / ratio, at.y / ratio];
  }

  /** @param {Iterable<number>} at */
  ringAt([x, y]) {
    if (!this.frame || !this.show) return null;
    const near = this.joints.map((joint) => [joint, Math.hypot(this.ring(joint)[0] - x, this.ring(joint)[1] - y)]);
    near.sort((one, other) => one[1] - other[1]);
    return near.length && near[0][1] <= TOUCH_PX ? near[0][0] : null;
  }

  // The puppet follows as far as its habits let it; the rest of the way is a string from ring to finger.
  drawString(ink, from, to, ratio) {
    ink.strokeStyle = STRING;
    ink.lineWidth = 2 * ratio;
    ink.beginPath();
    ink.moveTo(from[0] * ratio, from[1] * ratio);
    ink.lineTo(to[0] * ratio, to[1] * ratio);
    ink.stroke();
    ink.beginPath();
    ink.arc(to[0] * ratio, to[1] * ratio, 6 * ratio, 0, 7);
    ink.stroke();
  }

  draw() {
    super.draw();
    if (!this.frame || !this.show || this.frame.positions.length !== 3 * this.show.joints.length) return;
    const ink = this.canvas.getContext("2d"), ratio = this.canvas.width / this.canvas.clientWidth;
    for (const joint of this.joints) {
      const [x, y] = this.ring(joint), isHeld = this.holding(joint);
      ink.strokeStyle = isHeld ? HELD : FREE;
      ink.lineWidth = (isHeld ? 5 : 3) * ratio;
      ink.beginPath();
      if (this.isPlaced(joint)) ink.rect((x - 20) * ratio, (y - 20) * ratio, 40 * ratio, 40 * ratio);
      else ink.arc(x * ratio, y * ratio, 22 * ratio, 0, 7);
      ink.stroke();
    }
    for (const { joint, at } of this.taken.values()) this.drawString(ink, this.ring(joint), at, ratio);
  }
}
