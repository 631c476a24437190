// Motion that is made ahead: how far from the phrase, which walk, which path over the map; again, and keep.
import { command, say } from "./device.js";
import { byId } from "./elements.js";
import { initMap, showMap } from "./map.js";
import { slider } from "./slider.js";
import { number, words } from "./words.js";

const FADE_S = 1;
const USUAL_SIGMA = 2, MOST_SIGMA = 4; // beyond two a body may come apart: behind a lock
// By source: its dials as name, least, most, step, digits. docs/osc.md has the bounds.
const DIALS = {
  vary: [["sigma", 0, USUAL_SIGMA, 0.05, 2]],
  granular: [["spread", 0, 3, 0.05, 2], ["speed", 0.05, 5, 0.05, 2], ["mix", 0, 1, 0.02, 2], ["offset", -3, 3, 0.1, 1]],
  path: [["wobble", 0, 2, 0.05, 2], ["frequency", 0.05, 4, 0.05, 2]],
  improvise: [["temperature", 0, 2, 0.05, 2], ["seconds", 5, 60, 1, 0]],
};
const BETWEEN = ["mix", "offset"]; // for two phrases only

export function initMotion() {
  for (const [source, dials] of Object.entries(DIALS)) {
    const part = byId(`motion-${source}`);
    part.prepend(...dials.map((numbers) => dial(source, ...numbers)), seed(source));
  }
  byId("sigma-unlocked").addEventListener("change", lock);
  byId("motion-again").addEventListener("click", () => command("/motion/again"));
  byId("motion-keep-form").addEventListener("submit", (event) => {
    event.preventDefault();
    const name = byId("motion-keep-name").value.trim();
    if (name) command("/motion/keep", name);
    else say(words("keep_name_missing"), true);
  });
  initMap();
}

// Only the controls of what is danced, and of that only what this show carries.
export function showMotion(value, show) {
  const now = value.phrases.find((one) => one.now)?.name, section = DIALS[now] && show?.motion?.[now];
  byId("motion-part").hidden = !section;
  for (const source of Object.keys(DIALS)) byId(`motion-${source}`).hidden = !section || source !== now;
  if (!section) return;
  const declared = (name) => value.motion[`${now} ${name}`]?.[0] ?? section[name];
  for (const [name, , , , digits] of DIALS[now]) {
    const id = `${now}-${name}`;
    byId(id).parentElement.hidden = BETWEEN.includes(name) && !section.from;
    if (name === "sigma" && declared(name) > USUAL_SIGMA) unlock();
    if (document.activeElement !== byId(id)) byId(id).value = declared(name);
    showValue(id, digits);
  }
  if (document.activeElement !== byId(`${now}-seed`)) byId(`${now}-seed`).value = declared("seed");
  if (now === "path") showMap(value.motion["path points"] ?? [], show.generation);
}

function dial(source, name, least, most, step, digits) {
  const id = `${source}-${name}`;
  return slider({
    id, label: words(`motion_${name}`), least, most, step, onInput: () => showValue(id, digits),
    act: (value) => command(`/motion/${source}/${name}`, value, FADE_S),
  });
}

function seed(source) {
  const label = document.createElement("label"), what = document.createElement("span"), input = document.createElement("input");
  label.className = "field";
  what.textContent = words("motion_seed");
  Object.assign(input, { id: `${source}-seed`, type: "number", min: 0, max: 999999, step: 1, inputMode: "numeric" });
  input.addEventListener("change", () => {
    if (input.checkValidity() && input.value !== "") command(`/motion/${source}/seed`, Number(input.value));
    input.blur();
  });
  label.append(what, input);
  return label;
}

function showValue(id, digits) { byId(`${id}-said`).textContent = number(Number(byId(id).value), digits); }

function lock() { byId("vary-sigma").max = byId("sigma-unlocked").checked ? MOST_SIGMA : USUAL_SIGMA; }

function unlock() {
  if (byId("sigma-unlocked").checked) return;
  byId("sigma-unlocked").checked = true;
  lock();
}
