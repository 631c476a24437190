// The cue stack: the cue in force, the next one on the GO button, and the list, in which a tap chooses the next one.
import { pictureOfStyle } from "./choices.js";
import { command } from "./device.js";
import { byId } from "./elements.js";
import { number, words } from "./words.js";

const BOUNCE_MS = 500; // a second GO within this time is the same press
let cues = [], facts = {}, styles = {}, current = "", standby = null, pressedAt = -BOUNCE_MS;

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

// show: what the show says of its cues and looks; null before it is known.
export function showCues(value, show) {
  const cue = value.status?.cue ?? "";
  const isNew = cue !== current;
  if (isNew) standby = null;
  [cues, current, styles] = [value.cues, cue, show?.look_styles ?? {}];
  facts = Object.fromEntries((show?.cues ?? []).map((one) => [one.name, one]));
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
  const next = nextPlace(), list = byId("cues"), names = JSON.stringify(cues.map(({ name }) => [name, changes(name), pictureOf(name)]));
  setText(byId("now-name"), current || words("cue_none"));
  setText(byId("go-name"), next < 0 ? words("cue_end") : cues[next].name);
  setText(byId("go-what"), next < 0 ? "" : changes(cues[next].name));
  byId("go").disabled = next < 0;
  if (list.dataset.names !== names) {
    list.dataset.names = names;
    list.replaceChildren(...cues.map((one, place) => {
      const item = document.createElement("li"), button = document.createElement("button");
      const count = document.createElement("span"), image = document.createElement("img"), name = document.createElement("b");
      const [what, state] = ["small", "small"].map((tag) => document.createElement(tag));
      button.type = "button";
      count.textContent = String(place + 1);
      image.alt = "";
      image.src = pictureOf(one.name) ?? "data:,";
      image.hidden = !pictureOf(one.name);
      name.textContent = one.name;
      what.textContent = changes(one.name);
      button.append(count, image, name, what, state);
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

// The changes of a cue that the house sees, and the time that they take.
function changes(name) {
  const { look, lights, phrase, master, fade_s: fade, at } = facts[name] ?? {};
  const level = master === undefined ? undefined : `${Math.round(100 * master)} %`;
  const time = fade === undefined ? undefined : `${number(fade, fade % 1 ? 1 : 0)} s`;
  return [look, phrase, lights, level, time, at].filter(Boolean).join(" · ");
}

const pictureOf = (name) => styles[facts[name]?.look] && pictureOfStyle(styles[facts[name].look].style);

function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
