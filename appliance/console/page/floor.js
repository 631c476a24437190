// The stage's floor from above: a finger says where the puppet dances to, and a dot shows where each one is.
import { command } from "./device.js";
import { byId } from "./elements.js";

const REACH_M = 3, STEP_M = 0.1, HEAD_BYTES = 16; // a frame's: tick, flags, joints
const INK = { grid: "#2d323a", puppet: "#b3b7bd", led: "#ffffff", goal: "#ff8a5c" };
let places = [], goal = [], joints = 0, puppets = 1;

export function initFloor(box) {
  const canvas = byId("floor");
  canvas.addEventListener("pointerdown", (event) => {
    const drawn = canvas.getBoundingClientRect();
    const share = (value) => Math.min(1, Math.max(-1, 2 * value - 1));
    send([REACH_M * share((event.clientX - drawn.left) / drawn.width), REACH_M * share((event.clientY - drawn.top) / drawn.height)]);
  });
  canvas.addEventListener("keydown", (event) => {
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }, way = ways[event.key];
    if (!way) return;
    event.preventDefault();
    const from = goal.length ? goal : places[0] ?? [0, 0];
    send(from.map((value, axis) => Math.min(REACH_M, Math.max(-REACH_M, value + STEP_M * way[axis]))));
  });
  byId("floor-back").addEventListener("click", () => send([]));
  box.addEventListener("frame", (event) => see(event.detail));
}

// given: the goal in force, x and z in metres, or nothing.
export function showFloor(given, show) {
  byId("floor-part").hidden = !show?.goes_on;
  joints = show?.joints.length ?? 0;
  puppets = Math.max(1, show?.puppets.length ?? 1);
  goal = given ?? [];
  draw();
}

function send(wanted) {
  goal = wanted;
  draw();
  command("/goal", ...wanted.map((value) => Number(value.toFixed(2))));
}

function see(frame) {
  if (byId("floor-part").hidden || !joints || frame.byteLength < HEAD_BYTES + puppets * 32 * joints) return;
  const view = new DataView(frame);
  places = Array.from({ length: puppets }, (_, puppet) => {
    const at = HEAD_BYTES + 32 * joints * puppet + 16 * joints; // behind the world rotations: the root's place
    return [view.getFloat32(at, true), view.getFloat32(at + 8, true)];
  });
  draw();
}

function draw() {
  const canvas = byId("floor"), ratio = Math.min(devicePixelRatio || 1, 2);
  if (canvas.offsetParent === null) return;
  const size = Math.round(canvas.clientWidth * ratio);
  if (canvas.width !== size) [canvas.width, canvas.height] = [size, size];
  const ink = canvas.getContext("2d"), across = (metres) => (metres / REACH_M + 1) * size / 2;
  ink.clearRect(0, 0, size, size);
  ink.fillStyle = INK.grid;
  for (let metres = -REACH_M; metres <= REACH_M; metres++) {
    ink.fillRect(across(metres), 0, ratio, size);
    ink.fillRect(0, across(metres), size, ratio);
  }
  /** @param {number[]} at @param {number} radius @param {string} colour */
  const dot = ([x, z], radius, colour) => {
    ink.fillStyle = colour;
    ink.beginPath();
    ink.arc(across(x), across(z), radius * ratio, 0, 7);
    ink.fill();
  };
  places.forEach((place, number) => dot(place, 8, number ? INK.puppet : INK.led));
  if (goal.length) dot(goal, 5, INK.goal);
}
