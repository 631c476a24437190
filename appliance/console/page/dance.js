// The dance in 3D, drawn on a plain canvas: a body of capsules, its shadow, a floor. No library, no graphics card.
import { jointName, nameJoints } from "./joints.js";
import { multiplied } from "./rotation.js";

const HEAD_BYTES = 16; // tick (float64), flags, joints (uint32): stage_view.py
const GRID_M = 3;
const NEAR_M = 4.5, BACK = 1.8; // the eye from one dancer; and for each metre that several are from their middle
const GHOST = 2, GHOST_M = 1.0; // a flag of a frame: stage_view.py; how far beside the puppet the phrase is drawn
const HELD = 0.01; // less is not seen
const FILLS = 0.84, MIDDLE = 0.46, ABOVE_M = 0.12, WIDE_M = 1.5; // how much of the height a body takes, and where its middle is; above its highest joint; how wide one is
const RISES = 0.2, SETTLES = 0.01; // how fast the picture makes room for raised arms, and takes it back, frame by frame
const INK = { body: [238, 226, 206], hand: [255, 138, 92], ghost: [98, 118, 142], floor: "#2a2f36", shadow: "#000000" };

export class Dance {
  constructor(canvas, caption, box, words) {
    this.canvas = canvas;
    this.caption = caption;
    this.box = box;
    this.words = words;
    this.yaw = 0.5;
    this.pitch = 0.12;
    this.zoom = 1;
    this.centre = null;
    this.away = null;
    this.tall = null;
    this.spread = 0;
    this.show = null;
    this.frame = null;
    this.generation = -1;
    this.drawn = null;
    this.isAwaited = false;
    box.addEventListener("frame", (event) => this.take(event.detail));
    box.addEventListener("beat", () => this.redraw());
    new ResizeObserver(() => this.redraw()).observe(canvas);
    this.turnBy(canvas);
  }

  // With the next picture of the display: where nothing new came, a phone draws nothing.
  redraw() {
    if (this.isAwaited || this.canvas.offsetParent === null) return;
    this.isAwaited = true;
    requestAnimationFrame(() => {
      this.isAwaited = false;
      if (this.canvas.offsetParent !== null) this.draw();
    });
  }

  // A new stage may dance another skeleton.
  async follow(value) {
    if (value.generation === this.generation || value.generation === 0) return;
    try {
      const show = await (await fetch("/api/show")).json();
      this.generation = show.generation;
      this.show = show.joints ? show : null;
      if (this.show) nameJoints(show);
    } catch { /* asked again with the next word of the box */ }
  }

  take(buffer) {
    if (this.canvas.offsetParent === null) return; // on another page
    const head = new DataView(buffer), joints = head.getUint32(12, true);
    const source = head.getUint32(8, true) & GHOST ? new Float32Array(buffer, buffer.byteLength - 16 * joints, 4 * joints) : null;
    const puppets = (buffer.byteLength - HEAD_BYTES - (source?.byteLength ?? 0)) / (32 * joints);
    if (!Number.isInteger(puppets) || puppets < 1) return;
    const figures = Array.from({ length: puppets }, (_, puppet) => {
      const numbers = new Float32Array(buffer, HEAD_BYTES + 32 * joints * puppet, 8 * joints);
      return { world: numbers.subarray(0, 4 * joints), positions: numbers.subarray(4 * joints, 7 * joints), holds: numbers.subarray(7 * joints) };
    });
    this.frame = { tick: head.getFloat64(0, true), figures, source, ...figures[0] }; // fingers and words are the first one's
    this.takenAt = performance.now();
    this.redraw();
  }

  turnBy(canvas) {
    const fingers = new Map();
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    const gone = (event) => fingers.delete(event.pointerId);
    canvas.addEventListener("pointerup", gone);
    canvas.addEventListener("pointercancel", gone);
    canvas.addEventListener("pointermove", (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const at = [event.clientX, event.clientY];
      if (fingers.size === 1) this.turn((at[0] - before[0]) / 150, (at[1] - before[1]) / 150);
      else {
        const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
        const apart = (one) => Math.hypot(one[0] - other[0], one[1] - other[1]);
        this.magnify(apart(at) / Math.max(apart(before), 1));
      }
      fingers.set(event.pointerId, at);
    });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.magnify(Math.exp(-event.deltaY / 500));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const ways = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] };
      if (ways[event.key]) this.turn(...ways[event.key]);
      else if (event.key === "+") this.magnify(1.1);
      else if (event.key === "-") this.magnify(1 / 1.1);
      else return;
      event.preventDefault();
    });
  }

  turn(yaw, pitch) {
    this.yaw += yaw;
    this.pitch = Math.min(1.4, Math.max(-0.2, this.pitch + pitch));
    this.seen();
  }

  // From a side, at the size of the start.
  look(yaw, pitch) {
    [this.yaw, this.pitch, this.zoom] = [yaw, pitch, 1];
    this.seen();
  }

  seen() {
    this.canvas.dispatchEvent(new Event("turned"));
    this.redraw();
  }

  magnify(by) {
    this.zoom = Math.min(4, Math.max(0.4, this.zoom * by));
    this.redraw();
  }

  draw() {
    const { canvas, frame, show } = this, ratio = Math.min(devicePixelRatio || 1, 2);
    const wide = Math.round(canvas.clientWidth * ratio), high = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== wide || canvas.height !== high) [canvas.width, canvas.height] = [wide, high];
    const ink = canvas.getContext("2d");
    ink.clearRect(0, 0, wide, high);
    if (!frame || !show || frame.positions.length !== 3 * show.joints.length) {
      this.showSentence(this.words(this.box.framesWanted ? "no_dance" : "dance_off"));
      return;
    }
    const roots = frame.figures.map((figure) => pointOf(figure, 0));
    const ghost = frame.source && show.offsets ? this.ghost(frame) : null;
    if (ghost) roots.push(pointOf(ghost, 0));
    const middle = [0, 2].map((axis) => roots.reduce((sum, one) => sum + one[axis], 0) / roots.length);
    const share = frame === this.drawn ? 0 : 0.05; // the eye follows the dance, frame by frame
    this.drawn = frame;
    this.centre ??= middle;
    this.centre = this.centre.map((value, axis) => value + share * (middle[axis] - value));
    const apart = Math.max(...roots.map((one) => Math.hypot(one[0] - middle[0], one[2] - middle[1])));
    const away = NEAR_M + BACK * apart;
    this.away ??= away;
    this.away += share * (away - this.away);
    const top = ABOVE_M + Math.max(...frame.figures.flatMap(({ positions }) => [...positions.filter((_, place) => place % 3 === 1)]));
    this.tall ??= top;
    this.tall += (share && (top > this.tall ? RISES : SETTLES)) * (top - this.tall);
    this.spread = apart;
    const eye = this.eye(wide, high);
    this.drawFloor(ink, eye, ratio);
    const bones = [...frame.figures, ...ghost ? [ghost] : []].flatMap((figure) => this.bones(figure));
    ink.lineCap = "round";
    ink.strokeStyle = INK.shadow;
    ink.globalAlpha = 0.45;
    for (const { from, to, radius } of bones) this.stroke(ink, eye([from[0], 0, from[2]]), eye([to[0], 0, to[2]]), 1.6 * radius);
    ink.globalAlpha = 1;
    const seen = bones.map((bone) => ({ ...bone, a: eye(bone.from), b: eye(bone.to) }));
    seen.sort((one, other) => other.a.away + other.b.away - one.a.away - one.b.away);
    for (const { a, b, radius, held, body } of seen) this.drawBone(ink, a, b, radius, held, body);
    for (const figure of frame.figures) {
      for (const joint of this.heldJoints(figure)) this.drawRing(ink, eye(pointOf(figure, joint)), ratio, figure.holds[joint]);
    }
    const isOld = performance.now() - this.takenAt > 1500;
    const names = this.heldJoints().map((joint) => show.joints[joint]);
    this.showSentence(isOld ? this.words("dance_stands") : names.length ? this.words("held", { names: names.map(jointName).join(", ") }) : this.words("free"));
  }

  // The phrase that the puppet starts from, as a figure next to it, to its right as the eye sees it.
  ghost({ source, positions }) {
    const { joints, parents, offsets } = this.show, world = [], places = [];
    joints.forEach((_, joint) => {
      const parent = parents[joint], turned = source.subarray(4 * joint, 4 * joint + 4);
      world.push(parent < 0 ? [...turned] : multiplied(world[parent], turned));
      places.push(parent < 0 ? [0, 0, 0] : rotated(world[parent], offsets[joint]).map((value, axis) => value + places[parent][axis]));
    });
    const ends = this.show.ends.map(([joint, offset]) => places[joint][1] + rotated(world[joint], offset)[1]);
    const floor = Math.min(...places.map((place) => place[1]), ...ends);
    const beside = [positions[0] + GHOST_M * Math.cos(this.yaw), -floor, positions[2] - GHOST_M * Math.sin(this.yaw)];
    return {
      world: new Float32Array(world.flat()), holds: new Float32Array(joints.length), body: INK.ghost,
      positions: new Float32Array(places.flatMap((place) => place.map((value, axis) => value + beside[axis]))),
    };
  }

  /** @param {{ holds: Float32Array }} figure */
  heldJoints(figure = this.frame) {
    return this.show.joints.map((_, joint) => joint).filter((joint) => figure.holds[joint] > HELD);
  }

  showSentence(sentence) {
    if (this.caption.textContent !== sentence) this.caption.textContent = sentence;
  }

  // From metres to pixels, with the distance from the eye: so near that the tallest body fills the height, or all of them the width.
  eye(wide, high) {
    const [sy, cy, sp, cp] = [Math.sin(this.yaw), Math.cos(this.yaw), Math.sin(this.pitch), Math.cos(this.pitch)];
    const size = this.away * Math.min(FILLS * high / this.tall, wide / (WIDE_M + 2 * this.spread)) * this.zoom, [x0, z0] = this.centre;
    return ([x, y, z]) => {
      const side = cy * (x - x0) - sy * (z - z0), near = sy * (x - x0) + cy * (z - z0), up = y - MIDDLE * this.tall;
      const away = Math.max(0.4, this.away - (cp * near + sp * up)), scale = size / away;
      return { x: wide / 2 + scale * side, y: high / 2 - scale * (cp * up - sp * near), away, scale };
    };
  }

  bones(figure) {
    const { show } = this, point = (joint) => pointOf(figure, joint);
    const bones = [];
    const add = (joint, from, to) => {
      const name = show.joints[joint].toLowerCase(), length = Math.hypot(...from.map((v, axis) => to[axis] - v));
      const trunk = /hip|pelvis|root|spine|torso|chest|back/.test(name);
      const radius = /head/.test(name) ? 0.085 : Math.min(trunk ? 0.085 : 0.055, Math.max(0.022, 0.2 * length));
      if (length > 0.005) bones.push({ from: [...from], to: [...to], radius, held: figure.holds[joint], joint, body: figure.body ?? INK.body });
    };
    show.parents.forEach((parent, joint) => { if (parent >= 0) add(parent, point(parent), point(joint)); });
    for (const [joint, offset] of show.ends) {
      const turned = rotated(figure.world.subarray(4 * joint, 4 * joint + 4), offset), from = point(joint);
      add(joint, from, turned.map((value, axis) => value + from[axis]));
    }
    return bones;
  }

  drawBone(ink, a, b, radius, held, body) {
    const light = Math.min(1, Math.max(0.45, 1.25 - 0.16 * ((a.away + b.away) / 2 - 3)));
    const colour = body.map((value, part) => value + held * (INK.hand[part] - value)); // as firmly as it is held
    const shade = (part) => `rgb(${colour.map((value) => Math.round(value * light * part)).join(" ")})`;
    ink.strokeStyle = "#0d0f11";
    this.stroke(ink, a, b, radius * 1.22);
    ink.strokeStyle = shade(0.62);
    this.stroke(ink, a, b, radius);
    ink.strokeStyle = shade(1);
    const shift = 0.22 * radius;
    const lit = (end) => ({ ...end, x: end.x - shift * end.scale, y: end.y - shift * end.scale });
    this.stroke(ink, lit(a), lit(b), radius * 0.6);
  }

  stroke(ink, a, b, radius) {
    ink.lineWidth = Math.max(1, radius * (a.scale + b.scale));
    ink.beginPath();
    ink.moveTo(a.x, a.y);
    ink.lineTo(b.x, b.y);
    ink.stroke();
  }

  drawRing(ink, at, ratio, held) {
    ink.globalAlpha = held;
    ink.strokeStyle = `rgb(${INK.hand.join(" ")})`;
    ink.lineWidth = 3 * ratio;
    ink.beginPath();
    ink.arc(at.x, at.y, Math.max(12 * ratio, 0.12 * at.scale), 0, 7);
    ink.stroke();
    ink.globalAlpha = 1;
  }

  drawFloor(ink, eye, ratio) {
    ink.strokeStyle = INK.floor;
    ink.lineWidth = ratio;
    ink.beginPath();
    const [x0, z0] = this.centre.map((value) => Math.round(2 * value) / 2);
    for (let step = -GRID_M; step <= GRID_M; step += 0.5) {
      for (const [from, to] of [[[x0 + step, 0, z0 - GRID_M], [x0 + step, 0, z0 + GRID_M]], [[x0 - GRID_M, 0, z0 + step], [x0 + GRID_M, 0, z0 + step]]]) {
        const [a, b] = [eye(from), eye(to)];
        ink.moveTo(a.x, a.y);
        ink.lineTo(b.x, b.y);
      }
    }
    ink.stroke();
  }
}

const pointOf = (figure, joint) => figure.positions.subarray(3 * joint, 3 * joint + 3);

// A vector turned by a unit quaternion w, x, y, z.
function rotated([w, x, y, z], [a, b, c]) {
  const [s, t, u] = [2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)];
  return [a + w * s + y * u - z * t, b + w * t + z * s - x * u, c + w * u + x * t - y * s];
}
