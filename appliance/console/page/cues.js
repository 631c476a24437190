// The cue stack: the cue in force, the next one on the GO button, and the list, in which a tap chooses the next one.
import { command } from "./device.js";
import { byId } from "./elements.js";
import { words } from "./words.js";

const BOUNCE_MS = 500; // a second GO within this time is the same press
let cues = [], current = "", standby = null, pressedAt = -BOUNCE_MS;

// The place of the cue that GO calls up; -1 at the end of the list.
function nextPlace() {
  const chosen = cues.findIndex((one) => one.name === standby);
  if (chosen >= 0) return chosen;
  const place = cues.findIndex((one) => one.name === current);
  return place + 1 < cues.length ? place + 1 : -1;
}

export async function goOn() {
  const place = nextPlace(), now = performance.now();
  if (place < 0 || now - pressedAt < BOUNCE_MS) return;
  pressedAt = now;
  const { name } = cues[place];
  const done = await command("/cue", name); // by the name that the button shows
  if (!done || name !== current || name !== standby) return;
  standby = null; // the cue in force was called again: else GO would stay with it for ever
  draw();
}

export function showCues(value) {
  const cue = value.status?.cue ?? "";
  const isNew = cue !== current;
  if (isNew) standby = null;
  [cues, current] = [value.cues, cue];
  for (const id of ["cues-part", "go", "now"]) byId(id).hidden = cues.length === 0;
  draw();
  if (isNew) showCurrent();
}

// In a list that is longer than its place, on a laptop.
function showCurrent() {
  const item = byId("cues").querySelector('[aria-current="true"]')?.parentElement;
  if (item) byId("cues-part").scrollTop = item.offsetTop - byId("cues-part").clientHeight / 3;
}

function draw() {
  const next = nextPlace(), list = byId("cues"), names = JSON.stringify(cues.map((one) => one.name));
  setText(byId("now-name"), current || words("cue_none"));
  setText(byId("go-name"), next < 0 ? words("cue_end") : cues[next].name);
  byId("go").disabled = next < 0;
  if (list.dataset.names !== names) {
    list.dataset.names = names;
    list.replaceChildren(...cues.map((one, place) => {
      const item = document.createElement("li"), button = document.createElement("button");
      const number = document.createElement("span"), name = document.createElement("b"), state = document.createElement("small");
      button.type = "button";
      number.textContent = String(place + 1);
      name.textContent = one.name;
      button.append(number, name, state);
      button.addEventListener("click", () => {
        standby = one.name;
        draw();
      });
      item.append(button);
      return item;
    }));
  }
  cues.forEach((one, place) => {
    const button = list.children[place].firstChild;
    button.setAttribute("aria-current", String(one.name === current));
    button.setAttribute("aria-pressed", String(place === next));
    setText(button.lastChild, one.name === current ? words("cue_here") : place === next ? words("cue_next") : "");
  });
}

function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
