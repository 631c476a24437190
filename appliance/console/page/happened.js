// The journal as a timeline; any stretch of it can be played again.
import { Dance } from "./dance.js";
import { withPin } from "./device.js";
import { byId } from "./elements.js";
import { clock, locale, number, translated, words } from "./words.js";

const HEAD_BYTES = 16, JOINT_BYTES = 32; // a frame's: dance.js
const SLOWEST_MS = 20, MANY = 5; // what fills the timeline's height
const INK = { late: "#ff7a66", skipped: "#f0b840", failed: "#d36bff", slowest: "#59636f", mark: "#f3ece0", order: "#58c27d" };
const exact = (seconds) => new Date(1000 * seconds).toLocaleTimeString(locale, { hourCycle: "h23" });

let runs = [], run = null, second = 0, again = null, dance = null;

export function initHappened() {
  byId("happened-run").addEventListener("change", () => choose(runs[Number(byId("happened-run").value)]));
  byId("happened-seconds").addEventListener("change", () => point(second));
  byId("happened-read").addEventListener("click", readHappened);
  byId("happened-dance").addEventListener("click", danceAgain);
  byId("happened-bunraku").addEventListener("click", (event) => {
    if (document.body.dataset.known === "yes") return;
    event.preventDefault();
    withPin(() => byId("happened-bunraku").click());
  });
  const slider = byId("happened-second"), canvas = byId("timeline");
  slider.addEventListener("input", () => point(Number(slider.value)));
  canvas.addEventListener("click", (event) => {
    const box = canvas.getBoundingClientRect();
    if (run) point(run.seconds * (event.clientX - box.left) / box.width);
  });
  addEventListener("resize", draw);
}

export async function readHappened() {
  const answer = await ask("/api/happened");
  if (answer !== null) runs = await answer.json();
  byId("happened-all").hidden = answer === null;
  if (answer === null) return;
  byId("happened-run").replaceChildren(...runs.map((one, place) => {
    const option = document.createElement("option"), date = new Date(1000 * one.begun).toLocaleDateString(locale);
    option.value = String(place);
    option.textContent = `${date} ${clock(one.begun)} · ${one.show} · ${number(one.seconds / 60, 1)} min`;
    return option;
  }));
  byId("happened-run").value = runs.length - 1;
  choose(runs.at(-1));
}

// Away from the page nothing is danced again.
export function stopHappened() {
  clearInterval(again);
  again = null;
  byId("again-part").hidden = true;
}

function choose(chosen) {
  run = chosen;
  stopHappened();
  byId("happened-second").max = Math.max(0, run.seconds - 1).toFixed(1);
  const sum = (values) => number(values.reduce((all, one) => all + one, 0));
  byId("happened-sum").textContent = words("happened_sum", {
    late: sum(run.late), skipped: sum(run.skipped), failed: sum(run.failed), slowest: number(Math.max(...run.slowest_ms), 1),
  });
  byId("happened-events").replaceChildren(...run.events.toReversed().map(([at, kind, said]) => {
    const item = document.createElement("li"), button = document.createElement("button");
    button.type = "button";
    button.textContent = exact(run.begun + at);
    button.addEventListener("click", () => point(at));
    item.append(button, ` ${words(`happened_${kind}`)}: ${said}`);
    return item;
  }));
  point(run.seconds - stretch());
}

function point(at) {
  second = Math.min(Math.max(0, at), Number(byId("happened-second").max));
  byId("happened-second").value = second;
  byId("happened-at").textContent = exact(run.begun + second);
  for (const ending of ["bvh", "glb", "bunraku"]) byId(`happened-${ending}`).href = `/api/happened/dance.${ending}?${part()}`;
  draw();
}

const part = () => new URLSearchParams({ run: run.number, from: second.toFixed(2), seconds: String(stretch()) });
const stretch = () => Number(byId("happened-seconds").value);

function draw() {
  const canvas = byId("timeline"), ratio = Math.min(devicePixelRatio || 1, 2);
  if (!run || canvas.offsetParent === null) return;
  const wide = Math.round(canvas.clientWidth * ratio), high = Math.round(canvas.clientHeight * ratio);
  [canvas.width, canvas.height] = [wide, high];
  const ink = canvas.getContext("2d"), across = (at) => (at / run.seconds) * wide;
  const step = across(run.bin_s), floor = high - 14 * ratio;
  const bars = (values, most, colour) => {
    ink.fillStyle = colour;
    values.forEach((value, place) => {
      const tall = value ? Math.max(2 * ratio, floor * Math.min(1, value / most)) : 0;
      ink.fillRect(place * step, floor - tall, Math.max(1, step - 0.5), tall);
    });
  };
  bars(run.slowest_ms, SLOWEST_MS, INK.slowest);
  for (const what of ["late", "skipped", "failed"]) bars(run[what], MANY, INK[what]);
  ink.fillStyle = INK.order;
  for (const [at, kind] of run.events) if (kind === "order") ink.fillRect(across(at), floor + 3 * ratio, 2 * ratio, 9 * ratio);
  ink.fillStyle = INK.mark;
  ink.fillRect(across(second) - ratio, 0, 2 * ratio, high);
}

async function danceAgain() {
  stopHappened();
  const answer = await ask(`/api/happened/stretch?${part()}`);
  if (answer === null) return;
  const whole = await answer.arrayBuffer(), text = new DataView(whole).getUint32(0, true);
  const facts = JSON.parse(new TextDecoder().decode(new Uint8Array(whole, 4, text)));
  const bytes = HEAD_BYTES + JOINT_BYTES * facts.joints.length, frames = [];
  for (let at = 4 + text; at + bytes <= whole.byteLength; at += bytes) frames.push(whole.slice(at, at + bytes));
  byId("again-part").hidden = false;
  byId("again").scrollIntoView({ block: "center" });
  dance ??= new Dance(byId("again"), byId("again-held"), Object.assign(new EventTarget(), { framesWanted: true }), words);
  dance.show = facts;
  dance.centre = dance.away = null;
  const begun = performance.now();
  const next = () => {
    const shown = Math.floor((performance.now() - begun) / (1000 * facts.every_s)) % frames.length;
    dance.take(frames[shown]);
    byId("again-at").textContent = exact(facts.begun + facts.start_s + shown * facts.every_s);
  };
  next();
  again = setInterval(next, 1000 * facts.every_s);
}

// The answer, or null where there is none; then the page says why.
async function ask(path) {
  const say = (sentence) => { byId("happened-said").textContent = sentence; };
  say(words("happened_reading"));
  let answer = null;
  try {
    answer = await fetch(path);
  } catch { /* said below */ }
  say(answer?.ok ? "" : answer ? translated(await answer.text()) : words("no_page"));
  return answer?.ok ? answer : null;
}
