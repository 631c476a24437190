// The map of the dancer's poses: a tap is a place, a line is danced there and back.
import { request } from "./box.js";
import { command } from "./device.js";
import { byId } from "./elements.js";
import { words } from "./words.js";

const PATIENCE_MS = 60_000;
const MOST_POINTS = 16, STEP = 0.02, TAP = 0.03; // shares of the map's width
const INK = { path: "#6b7480", figure: "#b3b7bd", line: "#ff8a5c" };
let ground = null, groundOf = -1, drawn = null, points = [], cursor = [0.5, 0.5];

export function initMap() {
  const canvas = byId("map");
  const place = (event) => {
    const box = canvas.getBoundingClientRect();
    const share = (value) => Math.min(1, Math.max(0, value));
    return [share((event.clientX - box.left) / box.width), share(1 - (event.clientY - box.top) / box.height)];
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    drawn = [place(event)];
    draw();
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!drawn) return;
    const at = place(event), last = drawn.at(-1);
    if (Math.hypot(at[0] - last[0], at[1] - last[1]) > 0.005) drawn.push(at);
    draw();
  });
  canvas.addEventListener("pointerup", () => {
    if (drawn) send(evenly(drawn));
    drawn = null;
  });
  canvas.addEventListener("pointercancel", () => { drawn = null; draw(); });
  canvas.addEventListener("keydown", (event) => {
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }, way = ways[event.key];
    if (!way) return;
    event.preventDefault();
    cursor = cursor.map((value, axis) => Math.min(1, Math.max(0, value + STEP * way[axis])));
    send([cursor]);
  });
  byId("map-own").addEventListener("click", () => send([]));
  addEventListener("resize", draw);
}

// flat: the line in force, x and y of each point. generation: of the stage, another one has another map.
export async function showMap(flat, generation) {
  const given = [];
  for (let at = 0; at < flat.length; at += 2) given.push([flat[at], flat[at + 1]]);
  if (!drawn) points = given;
  byId("map-said").textContent = words(given.length > 1 ? "map_line" : given.length ? "map_point" : "map_own_path");
  draw();
  if (groundOf === generation) return;
  groundOf = generation;
  const answer = await request("/api/map", undefined, PATIENCE_MS);
  ground = answer.status === 200 ? answer.value : null;
  if (answer.status === 0) groundOf = -1; // the phone slept meanwhile: ask again
  draw();
}

function send(line) {
  points = line;
  if (line.length) cursor = line.at(-1);
  draw();
  command("/motion/path", ...line.flat().map((value) => Number(value.toFixed(3))));
}

// A tap stays a point; of a line as many places as the box takes, evenly along it.
function evenly(line) {
  const ways = [0];
  for (let at = 1; at < line.length; at++) ways.push(ways.at(-1) + Math.hypot(line[at][0] - line[at - 1][0], line[at][1] - line[at - 1][1]));
  if (ways.at(-1) < TAP) return [line[0]];
  const found = [];
  for (let place = 0, at = 0; place < MOST_POINTS; place++) {
    const wanted = ways.at(-1) * place / (MOST_POINTS - 1);
    while (at < line.length - 2 && ways[at + 1] < wanted) at++;
    const share = (wanted - ways[at]) / Math.max(1e-9, ways[at + 1] - ways[at]);
    found.push([0, 1].map((axis) => line[at][axis] + share * (line[at + 1][axis] - line[at][axis])));
  }
  return found;
}

function draw() {
  const canvas = byId("map"), ratio = Math.min(devicePixelRatio || 1, 2);
  if (canvas.offsetParent === null) return;
  const size = Math.round(canvas.clientWidth * ratio);
  [canvas.width, canvas.height] = [size, size];
  const ink = canvas.getContext("2d"), across = ([x, y]) => [x * size, (1 - y) * size];
  ink.lineCap = ink.lineJoin = "round";
  if (ground) {
    ink.fillStyle = INK.path;
    for (const [x, y] of ground.path.map(across)) ink.fillRect(x - ratio, y - ratio, 2 * ratio, 2 * ratio);
    for (const figure of ground.figures) {
      const [x, y] = across(figure.at), scale = ground.scale * size;
      for (const [[ax, ay], [bx, by]] of figure.bones) stroke(ink, [[x + ax * scale, y - ay * scale], [x + bx * scale, y - by * scale]], INK.figure, 2 * ratio);
    }
  }
  const line = (drawn ?? points).map(across);
  stroke(ink, line, INK.line, 4 * ratio);
  if (line.length) {
    ink.fillStyle = INK.line;
    ink.beginPath();
    ink.arc(...line.at(-1), 9 * ratio, 0, 7);
    ink.fill();
  }
}

function stroke(ink, line, colour, width) {
  ink.strokeStyle = colour;
  ink.lineWidth = width;
  ink.beginPath();
  line.forEach(([x, y], place) => (place ? ink.lineTo(x, y) : ink.moveTo(x, y)));
  ink.stroke();
}
