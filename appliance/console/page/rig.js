// The rig as it shines now, from the audience and from above; and a walk through it while the show stands.
import { request } from "./box.js";
import { command } from "./device.js";
import { byId } from "./elements.js";
import { words } from "./words.js";

const LOOK_MS = 200, WIDE_PX = 640;
const LONGEST_M = 12, MARGIN_M = 1.2, STAGE_M = 2;
const VIEWS = [["rig_front", 1, 1], ["rig_above", 2, -1]]; // words; the axis upwards, and its sense
const SLICES = 10, THROW = [0, 0.1, 0.25, 0.5, 0.75, 1]; // how finely a beam is drawn across and along
const STEEPEST = 1.5; // radians: a beam's far edge that never meets the floor
const INK = { floor: "#3d434b", quiet: "#b3b7bd", lamp: "#f3ece0", dark: "#22262b" };
let beams = [], isLit = false, isAsking = false;

export function initRig() {
  byId("rig-walk").addEventListener("click", () => command("/lights/walk"));
  byId("rig-end").addEventListener("click", () => command("/lights/walk/stop"));
  setInterval(look, LOOK_MS);
}

export function showRig(value) {
  isLit = value.processes.some((one) => one.process === "lights" && !one.late);
}

async function look() {
  if (!isLit || isAsking || document.hidden || byId("rig").offsetParent === null) return;
  isAsking = true;
  const answer = await request("/api/rig");
  isAsking = false;
  if (answer.status !== 200) return;
  beams = answer.value.beams;
  const walk = answer.value.walk;
  byId("rig-said").textContent = walk && words("rig_now", { description: walk });
  byId("rig-walk").hidden = Boolean(walk);
  byId("rig-end").hidden = !walk;
  lamps();
  draw();
}

// A button for each fixture, once, however many heads it has. They stay the same elements.
function lamps() {
  const levels = new Map(beams.map(([name, , , , level]) => [name, level])), parent = byId("lamps");
  const names = JSON.stringify([...levels.keys()]);
  if (parent.dataset.names !== names) {
    parent.dataset.names = names;
    parent.replaceChildren(...[...levels.keys()].map((name) => {
      const button = document.createElement("button");
      button.type = "button";
      button.addEventListener("click", () => command("/lights/walk", name));
      return button;
    }));
  }
  [...levels].forEach(([name, level], place) => { parent.children[place].textContent = words("rig_level", { name, level: Math.round(100 * level) }); });
}

function draw() {
  const canvas = byId("rig"), ratio = Math.min(devicePixelRatio || 1, 2);
  if (canvas.offsetParent === null) return;
  const isWide = canvas.clientWidth > WIDE_PX, rows = isWide ? 1 : 2;
  const views = VIEWS.map((view) => framed(...view));
  const across = canvas.clientWidth / (isWide ? 2 : 1);
  const heights = views.map((view) => 26 + across * (view.top - view.low) / (view.right - view.left));
  const high = isWide ? Math.max(...heights) : heights[0] + heights[1];
  [canvas.width, canvas.height] = [Math.round(canvas.clientWidth * ratio), Math.round(high * ratio)];
  canvas.style.height = `${high}px`;
  const ink = canvas.getContext("2d");
  views.forEach((view, place) => {
    const x = isWide ? place * across : 0, y = rows === 2 && place ? heights[0] : 0;
    ink.save();
    ink.beginPath();
    ink.rect(x * ratio, y * ratio, across * ratio, heights[place] * ratio);
    ink.clip();
    drawView(ink, view, x * ratio, y * ratio, across * ratio, ratio);
    ink.restore();
  });
}

// The extent of a view in metres: all lamps and the middle of the stage.
function framed(title, axis, sense) {
  const places = beams.map(([, place]) => [place[0], sense * place[axis]]);
  const [xs, ys] = [0, 1].map((side) => places.map((place) => place[side]));
  const floor = axis === 1 ? [0] : [-STAGE_M, STAGE_M];
  return {
    title, axis, sense,
    left: Math.min(-STAGE_M, ...xs) - MARGIN_M, right: Math.max(STAGE_M, ...xs) + MARGIN_M,
    low: Math.min(...floor, ...ys) - (axis === 1 ? 0.3 : 1) * MARGIN_M, top: Math.max(...floor, ...ys) + (axis === 1 ? 0.5 : 1) * MARGIN_M,
  };
}

function drawView(ink, view, x, y, wide, ratio) {
  const scale = wide / (view.right - view.left), top = y + 26 * ratio;
  const at = (point) => [x + (point[0] - view.left) * scale, top + (view.top - view.sense * point[view.axis]) * scale];
  ink.strokeStyle = INK.floor;
  ink.lineWidth = ratio;
  ink.beginPath();
  if (view.axis === 1) line(ink, at([view.left, 0, 0]), at([view.right, 0, 0]));
  else {
    for (let step = -STAGE_M; step <= STAGE_M; step++) {
      line(ink, at([step, 0, -STAGE_M]), at([step, 0, STAGE_M]));
      line(ink, at([-STAGE_M, 0, step]), at([STAGE_M, 0, step]));
    }
  }
  ink.stroke();
  ink.globalCompositeOperation = "lighter";
  for (const beam of beams) drawBeam(ink, beam, at, scale, view);
  ink.globalCompositeOperation = "source-over";
  for (const [, place, , colour, level] of beams) {
    const [px, py] = at(place);
    ink.fillStyle = level > 0.005 ? rgb(colour, 1) : INK.dark;
    ink.strokeStyle = INK.lamp;
    ink.lineWidth = 1.5 * ratio;
    ink.beginPath();
    ink.arc(px, py, 5 * ratio, 0, 7);
    ink.fill();
    ink.stroke();
  }
  drawNames(ink, at, ratio, [x, x + wide]);
  ink.font = `600 ${13 * ratio}px system-ui, sans-serif`;
  ink.fillStyle = INK.quiet;
  ink.fillText(words(view.title), x + 10 * ratio, y + 18 * ratio);
}

// The name of each lamp above or below it, where it covers no other; the buttons have them all.
function drawNames(ink, at, ratio, [left, right]) {
  const taken = beams.map(([, place]) => at(place)).map(([px, py]) => [px - 7 * ratio, py - 7 * ratio, px + 7 * ratio, py + 7 * ratio]);
  ink.font = `${12 * ratio}px system-ui, sans-serif`;
  ink.fillStyle = INK.lamp;
  ink.textAlign = "center";
  for (const [name, place] of new Map(beams.map((beam) => [beam[0], beam[1]]))) {
    const [px, py] = at(place), half = ink.measureText(name).width / 2;
    const [middle, high] = [Math.min(Math.max(px, left + half + 4), right - half - 4), 13 * ratio];
    for (const top of [py - 9 * ratio - high, py + 9 * ratio]) {
      const box = [middle - half - 3, top, middle + half + 3, top + high];
      if (taken.some((one) => box[0] < one[2] && one[0] < box[2] && box[1] < one[3] && one[1] < box[3])) continue;
      taken.push(box);
      ink.fillText(name, middle, top + 0.8 * high);
      break;
    }
  }
  ink.textAlign = "left";
}

// A cone to the floor that fades along its throw and towards its edge, and from above the pool where it meets the floor.
function drawBeam(ink, [, place, way, colour, level, degrees], at, scale, view) {
  if (level < 0.005) return;
  const hitsFloor = way[1] < -0.001 && place[1] / -way[1] < LONGEST_M, reach = hitsFloor ? place[1] / -way[1] : LONGEST_M;
  const end = place.map((value, axis) => value + reach * way[axis]), half = degrees * Math.PI / 360;
  const [from, to] = [at(place), at(end)], long = Math.hypot(to[0] - from[0], to[1] - from[1]) || 1;
  const isPlan = view.axis === 2, radius = reach * Math.tan(half) * scale;
  // To the side of the beam; on the floor, seen from the audience, along the floor.
  const aside = !isPlan && hitsFloor ? [radius, 0] : [-(to[1] - from[1]) / long * radius, (to[0] - from[0]) / long * radius];
  const seen = Math.sqrt(level); // the eye sees a dimmer at 25 % half as bright
  const cone = ink.createLinearGradient(...from, ...to);
  for (const share of THROW) cone.addColorStop(share, rgb(colour, 0.9 * seen / SLICES / (1 + 4 * share)));
  ink.fillStyle = cone;
  for (let slice = 1; slice <= SLICES; slice++) {
    const wide = slice / SLICES;
    ink.beginPath();
    ink.moveTo(...from);
    ink.lineTo(to[0] + wide * aside[0], to[1] + wide * aside[1]);
    ink.lineTo(to[0] - wide * aside[0], to[1] - wide * aside[1]);
    ink.fill();
  }
  if (isPlan && hitsFloor) drawPool(ink, { place, way, half, colour, seen, radius }, at, scale);
}

// An ellipse, long along the throw.
function drawPool(ink, { place, way, half, colour, seen, radius }, at, scale) {
  const slant = Math.acos(Math.min(1, -way[1])), flat = Math.hypot(way[0], way[2]) || 1;
  const near = place[1] * Math.tan(slant - half), far = Math.min(LONGEST_M, place[1] * Math.tan(Math.min(slant + half, STEEPEST)));
  const middle = (near + far) / 2, to = at([place[0] + middle * way[0] / flat, 0, place[2] + middle * way[2] / flat]);
  ink.save();
  ink.translate(...to);
  ink.rotate(Math.atan2(way[2], way[0]));
  ink.scale((far - near) / 2 * scale, radius);
  const pool = ink.createRadialGradient(0, 0, 0, 0, 0, 1);
  for (const share of THROW) pool.addColorStop(share, rgb(colour, 0.55 * seen * (1 - share ** 2) ** 2));
  ink.fillStyle = pool;
  ink.beginPath();
  ink.arc(0, 0, 1, 0, 7);
  ink.fill();
  ink.restore();
}

function line(ink, from, to) {
  ink.moveTo(...from);
  ink.lineTo(...to);
}

const rgb = (colour, alpha) => `rgb(${colour.map((value) => Math.round(255 * value)).join(" ")} / ${alpha})`;
