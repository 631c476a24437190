// The cue stack: the cue in force, the next one on the GO button, and the list, in which a tap chooses the next one.
import { pictureOfStyle } from "./choices.js";
import { command } from "./device.js";
import { offer } from "./idle.js";
import { byId } from "./elements.js";
import { number, words } from "./words.js";

const FOLLOWED = ["running", "freewheeling"]; // states of a timecode that calls cues
const BOUNCE_MS = 500; // a second GO within this time is the same press
const TICK_MS = 100; // while a fade runs
let cues = [], facts = {}, styles = {}, current = "", standby = null, pressedAt = -BOUNCE_MS;
let told = null, toldAt = 0, timer = 0; // the box's newest word and when it came

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
  [told, toldAt] = [value, performance.now()];
  [cues, current, styles] = [value.cues, cue, show?.look_styles ?? {}];
  facts = Object.fromEntries((show?.cues ?? []).map((one) => [one.name, one]));
  for (const id of ["cues-part", "go", "now"]) byId(id).hidden = cues.length === 0;
  draw();
  showTime();
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
  offer(byId("go"), next < 0 ? words("cue_end_how") : "");
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
    const where = one.name === current ? words("cue_here") : place === next ? words("cue_next") : "";
    setText(button.lastChild, [where, untilCalled(one.name)].filter(Boolean).join(" · "));
  });
}

// In how long the timecode calls a cue.
function untilCalled(name) {
  const { timecode, state } = told.remote ?? {}, at = facts[name]?.at;
  const left = at && timecode && FOLLOWED.includes(state) ? seconds(at) - seconds(timecode) : -1;
  return left >= 0 ? words("cue_in", { time: stopwatch(left) }) : "";
}

// Hours, minutes, seconds; without the frames.
function seconds(timecode) {
  const [hours, minutes, whole] = timecode.split(/[:;.]/).map(Number);
  return 3600 * hours + 60 * minutes + whole;
}

const two = (value) => String(value).padStart(2, "0");

function stopwatch(given) {
  const whole = Math.floor(given), minutes = Math.floor(whole / 60);
  return minutes < 60 ? `${minutes}:${two(whole % 60)}` : `${Math.floor(minutes / 60)}:${two(minutes % 60)}:${two(whole % 60)}`;
}

// How far the running fade is, and since when the cue is in force: between two words of the box by this device's clock.
export function showTime() {
  clearTimeout(timer);
  if (!told) return;
  const now = told.time + (performance.now() - toldAt) / 1000, share = shareOf(told.fade, now);
  byId("fade").value = share;
  byId("fade").classList.toggle("runs", share < 1);
  setText(byId("now-since"), current && told.cue_since ? stopwatch(Math.max(0, now - told.cue_since)) : "");
  const place = cues.findIndex((one) => one.name === current), fade = facts[current]?.fade_s;
  const own = fade && told.cue_since ? shareOf([told.cue_since, fade], now) : 1;
  [...byId("cues").children].forEach((item, at) => item.firstChild.style.setProperty("--share", at === place && own < 1 ? own : 0));
  if (Math.min(share, own) < 1 && !document.hidden) timer = setTimeout(showTime, TICK_MS);
}

const shareOf = (fade, now) => fade ? Math.min(1, Math.max(0, (now - fade[0]) / fade[1])) : 1;

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
