// Picture, in three parts: looks and cards; the wall; the rig (rig.js). The wall: brightness, grid, test card, figures, and corners that move on the wall as far as a finger moves here.
import { command, say } from "./device.js";
import { byId, every, first } from "./elements.js";
import { held } from "./hold.js";
import { words } from "./words.js";

const CORNERS = [[0, 0], [1, 0], [1, 1], [0, 1]]; // in the projector's order, and where they are without any change
const SWITCHES = ["grid", "test_card", "info"]; // what the projector calls them, and their addresses
const STEP_S = 0.12, NUDGE = 0.002;
const OWN_MS = 2500; // the projector tells once a second: until then this page's own change is the newest
const before = []; // for undo: the corners and the mesh, or the pull of one of its points, before each change made here
const MESH = 5; // points across and down
const INNER = [...Array(MESH * MESH).keys()].filter((place) => ![0, MESH - 1, MESH * (MESH - 1), MESH * MESH - 1].includes(place));
const LOOK_AGAIN_MS = 1800; // at the next word of the box: every two seconds
const PARTS = ["looks", "wall", "rig"];
let part = "looks"; // as it was chosen here; one that the box does not have gives way to the first that it has
const PATIENCE_MS = 10_000; // on a slow link a picture takes longer than that to come
let lookedAt = -PATIENCE_MS, isAsked = false;
let wall = null, ownUntil = 0, shown = CORNERS.map((one) => [...one]), pulls = [];

// A handle: its place, how it is drawn under a finger, and the order for a step.
const CORNER = {
  address: "/projector/nudge",
  at: (place) => shown[place],
  show: (place, point) => put(shown.map((one, other) => other === place ? point : one)),
  remember,
};
const POINT = {
  address: "/projector/warp",
  at: meshPoint,
  show: pullTo,
  remember: (place) => note({ place, pull: pulls[place] ?? [0, 0] }),
};
// With edge blend: a step of each value, and how it is said.
/** @type {Record<string, [number, (value: number) => string]>} */
const BLEND = {
  overlap: [0.002, (value) => `${(100 * value).toFixed(1)} %`],
  blend_gamma: [0.05, (value) => value.toFixed(2)],
};

export function initPicture() {
  for (const button of every("#picture-parts button")) {
    button.addEventListener("click", () => {
      part = button.dataset.part;
      showParts();
    });
  }
  for (const id of SWITCHES) {
    byId(id).addEventListener("click", () => switchOn(id, `/projector/${id}`, byId(id).getAttribute("aria-pressed") !== "true"));
  }
  held(byId("corners-reset"), () => change("/projector/corners/reset", [], CORNERS), (sentence) => say(sentence));
  byId("corners-undo").addEventListener("click", undo);
  for (const [event, sight] of [["load", "visible"], ["error", "hidden"]]) {
    byId("wall-now").addEventListener(event, () => {
      isAsked = false;
      byId("wall-now").style.visibility = sight;
    });
  }
  const brightness = byId("brightness");
  brightness.addEventListener("input", tellBrightness);
  brightness.addEventListener("change", () => {
    command("/projector/brightness", Number(brightness.value) / 100);
    ownUntil = performance.now() + OWN_MS;
    brightness.blur();
  });
  CORNERS.forEach((_, place) => byId("corners").append(handle(place, CORNER)));
  for (const place of INNER) {
    const point = handle(place, POINT);
    point.className = "point";
    point.dataset.point = String(place);
    byId("corners").append(point);
  }
  byId("mesh").addEventListener("click", () => {
    const isOn = byId("corners").classList.toggle("meshed");
    byId("mesh").setAttribute("aria-pressed", String(isOn));
    byId("mesh-reset").hidden = !isOn;
  });
  for (const id of Object.keys(BLEND)) byId("blend").append(stepper(id));
  held(byId("mesh-reset"), async () => {
    if (!await command("/projector/warp/reset")) return;
    ownUntil = performance.now() + OWN_MS;
    lay([]);
    before.splice(0, before.length, ...before.filter((one) => one.corners));
    tellUndo();
  }, (sentence) => say(sentence));
  put(shown);
}

// States as the projector tells them, unless this page changed them a moment ago.
export function showPicture(value) {
  const runs = (name) => value.processes.some((one) => one.process === name && !one.late);
  const projects = runs("projector");
  const has = { looks: value.looks.length > 0, wall: projects, rig: runs("lights") };
  for (const name of PARTS) first(`[data-part="${name}"]`).hidden = !has[name];
  const isThere = PARTS.some((name) => has[name]);
  byId("picture-none").hidden = isThere;
  byId("picture-parts").hidden = !isThere;
  showParts();
  lookAtWall(projects);
  wall = value.wall;
  if (!wall?.corners || performance.now() < ownUntil) return;
  if (document.activeElement !== byId("brightness")) byId("brightness").value = Math.round(100 * wall.brightness);
  tellBrightness();
  for (const id of SWITCHES) byId(id).setAttribute("aria-pressed", String(wall[id] === true));
  byId("blend").hidden = !wall.overlap;
  for (const [id, [, said]] of Object.entries(BLEND)) if (wall.overlap) byId(id).textContent = said(wall[id]);
  pulls = wall.warp ?? [];
  put(wall.corners);
}

// Shows the projector's newest picture of the wall while this page is on a screen.
function lookAtWall(projects) {
  byId("wall-part").hidden = !projects;
  const waits = performance.now() - lookedAt < (isAsked ? PATIENCE_MS : LOOK_AGAIN_MS);
  if (!projects || waits || document.visibilityState !== "visible" || byId("wall-now").offsetParent === null) return;
  isAsked = true;
  lookedAt = performance.now();
  byId("wall-now").src = `/api/wall.jpg?${Math.round(lookedAt)}`;
}

function showParts() {
  const there = PARTS.filter((name) => !first(`[data-part="${name}"]`).hidden), chosen = there.includes(part) ? part : there[0];
  for (const name of PARTS) {
    first(`[data-part="${name}"]`).setAttribute("aria-pressed", String(name === chosen));
    byId(`picture-${name}`).hidden = name !== chosen;
  }
}

function tellBrightness() { byId("brightness-said").textContent = `${byId("brightness").value} %`; }

async function switchOn(id, address, on) {
  if (!await command(address, on ? 1 : 0)) return;
  ownUntil = performance.now() + OWN_MS;
  byId(id).setAttribute("aria-pressed", String(on));
}

async function change(address, given, corners) {
  note({ corners: shown.map((one) => [...one]), warp: pulls.map((one) => [...one]) });
  if (await command(address, ...given)) {
    ownUntil = performance.now() + OWN_MS;
    pulls = []; // the mesh goes with the corners
    put(corners);
  } // else a projector that answers late may have done it all the same: it can be undone
  tellUndo();
}

async function undo() {
  const { corners, warp = [], place, pull } = before.at(-1) ?? {};
  if (corners && await command("/projector/corners", ...corners.flat())) {
    put(corners);
    for (const at of INNER.filter((one) => warp[one])) {
      const left = away(warp[at], pulls[at]);
      if (!left[0] && !left[1]) continue;
      if (!await command(POINT.address, at + 1, ...left)) return; // a projector that is busy: the next press goes on
      pulls[at] = warp[at];
    }
    lay(pulls);
  } else if (pull && await command(POINT.address, place + 1, ...away(pull, pulls[place]))) {
    pulls[place] = pull;
    lay(pulls);
  } else return;
  before.pop();
  ownUntil = performance.now() + OWN_MS;
  tellUndo();
}

/** @param {number[]} at @param {number[]} from */
function away([x, y], [fromX, fromY] = [0, 0]) { return [x - fromX, y - fromY]; }

// The whole pad is what the projector can light; the handles stay inside of it.
function put(corners) {
  shown = corners.map((one) => [...one]);
  byId("corners-shape").setAttribute("points", corners.map((one) => one.join(",")).join(" "));
  corners.forEach(([x, y], place) => {
    const button = byId("corners").querySelectorAll("button")[place];
    if (!button) return;
    button.style.left = `clamp(4px, ${100 * x}% - 32px, 100% - 68px)`;
    button.style.top = `clamp(4px, ${100 * y}% - 32px, 100% - 68px)`;
  });
  lay(pulls);
}

// The mesh hangs between the corners, in perspective as on the wall (corners.py); its points are pulled from there.
function hung(place) {
  const u = place % MESH / (MESH - 1), v = Math.floor(place / MESH) / (MESH - 1);
  const [[x0, y0], [x1, y1], [x2, y2], [x3, y3]] = shown;
  const [ax, ay, bx, by] = [x1 - x2, y1 - y2, x3 - x2, y3 - y2], [sx, sy] = [x0 - x1 + x2 - x3, y0 - y1 + y2 - y3];
  const area = ax * by - ay * bx, g = (sx * by - sy * bx) / area, h = (ax * sy - ay * sx) / area, w = g * u + h * v + 1;
  const x = (x1 - x0 + g * x1) * u + (x3 - x0 + h * x3) * v + x0, y = (y1 - y0 + g * y1) * u + (y3 - y0 + h * y3) * v + y0;
  return [x / w, y / w];
}

function meshPoint(place) {
  const [x, y] = hung(place), [dx, dy] = pulls[place] ?? [0, 0];
  return [x + dx, y + dy];
}

function pullTo(place, point) {
  pulls[place] = away(point, hung(place));
  layPoint(place, point);
}

function lay(warp) {
  pulls = warp;
  for (const place of INNER) layPoint(place, meshPoint(place));
}

/** @param {number} place @param {number[]} at */
function layPoint(place, [x, y]) {
  const button = byId("corners").querySelector(`[data-point="${place}"]`);
  if (!button) return;
  button.style.left = `clamp(2px, ${100 * x}% - 20px, 100% - 42px)`;
  button.style.top = `clamp(2px, ${100 * y}% - 20px, 100% - 42px)`;
}

// A value between two buttons, each press one fine step.
function stepper(id) {
  const [step, format] = BLEND[id], row = document.createElement("div"), what = document.createElement("span");
  const value = document.createElement("b"), to = (sign) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = sign < 0 ? "−" : "+";
    button.setAttribute("aria-label", `${words(id)} ${button.textContent}`);
    button.addEventListener("click", async () => {
      const wanted = wall[id] + sign * step;
      if (!await command(`/projector/${id}`, wanted)) return;
      ownUntil = performance.now() + OWN_MS;
      wall[id] = wanted;
      value.textContent = format(wanted);
    });
    return button;
  };
  row.className = "stepper";
  what.textContent = words(id);
  value.id = id;
  row.append(what, to(-1), value, to(1));
  return row;
}

function handle(place, what) {
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = place + 1;
  // at: where the finger is, sent: how far the wall has followed, both in shares of the picture. A step that the
  // projector was too busy for is sent again, at the end of a drag three times.
  let from = null, start = [0, 0], sent = [0, 0], at = [0, 0], timer = 0, isSending = false, misses = 0;
  const rest = () => {
    clearInterval(timer);
    sent = at = [0, 0];
  };
  const send = async () => {
    if (isSending) return;
    const [dx, dy] = [at[0] - sent[0], at[1] - sent[1]];
    if (Math.hypot(dx, dy) <= 0.0005) {
      if (!from) rest();
      return;
    }
    isSending = true;
    const done = await command(what.address, place + 1, dx, dy);
    isSending = false;
    ownUntil = performance.now() + OWN_MS;
    if (done) sent = [sent[0] + dx, sent[1] + dy];
    else if (document.body.dataset.known !== "yes" || (!from && ++misses === 3)) rest();
  };
  button.addEventListener("pointerdown", (event) => {
    button.setPointerCapture(event.pointerId);
    if (!wall?.grid && byId("grid").getAttribute("aria-pressed") !== "true") switchOn("grid", "/projector/grid", true);
    from = [event.clientX, event.clientY];
    start = [...what.at(place)];
    ownUntil = Infinity;
    [sent, at, misses] = [[sent[0] - at[0], sent[1] - at[1]], [0, 0], 0];
    clearInterval(timer);
    timer = setInterval(send, 1000 * STEP_S);
  });
  button.addEventListener("pointermove", (event) => {
    if (!from) return;
    const pad = byId("corners").getBoundingClientRect();
    if (!at[0] && !at[1]) what.remember(place);
    at = [(event.clientX - from[0]) / pad.width, (event.clientY - from[1]) / pad.height];
    what.show(place, [start[0] + at[0], start[1] + at[1]]);
  });
  const end = () => {
    if (!from) return;
    from = null;
    ownUntil = performance.now() + OWN_MS;
    send();
  };
  button.addEventListener("pointerup", end);
  button.addEventListener("pointercancel", end);
  button.addEventListener("keydown", async (event) => {
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const way = ways[event.key];
    if (!way) return;
    event.preventDefault();
    if (!event.repeat) what.remember(place);
    const [dx, dy] = [NUDGE * way[0], NUDGE * way[1]];
    if (!await command(what.address, place + 1, dx, dy)) return;
    const [x, y] = what.at(place);
    what.show(place, [x + dx, y + dy]); // before the box tells of it: a reset right after is undone to here
  });
  return button;
}

function remember() { note({ corners: shown.map((one) => [...one]) }); }

function note(one) {
  before.push(one);
  tellUndo();
}

function tellUndo() { byId("corners-undo").disabled = before.length === 0; }
