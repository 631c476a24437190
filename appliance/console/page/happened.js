// The journal as a timeline; any stretch of it can be played again.
import { Dance } from "./dance.js";
import { withPin } from "./device.js";
import { byId } from "./elements.js";
import { drawTimeline, secondAt, showLegend } from "./timeline.js";
import { clock, day, duration, exact, number, translated, words } from "./words.js";

const HEAD_BYTES = 16, JOINT_BYTES = 32; // a frame's: dance.js
const TOGETHER_S = 0.1; // what a cue changes is noted within one tick
const GROUPS_S = [60, 300, 900, 3600], MOST_GROUPS = 12;

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
    if (run) point(secondAt(run, event.clientX - box.left, box.width));
  });
  addEventListener("resize", draw);
}

export async function readHappened() {
  const answer = await ask("/api/happened");
  if (answer !== null) runs = await answer.json();
  byId("happened-all").hidden = answer === null;
  if (answer === null) return;
  byId("happened-run").replaceChildren(...runs.map((one, place) => {
    return new Option(`${day(one.begun)}, ${clock(one.begun)} · ${duration(one.seconds)} · ${one.show}`, String(place));
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
  byId("timeline").setAttribute("aria-label", `${words("timeline_label")}. ${byId("happened-sum").textContent}`);
  showLegend(byId("timeline-legend"));
  byId("happened-events").replaceChildren(...grouped(run.events).map(group));
  point(run.seconds - stretch());
}

// Entries of the same minutes together, the newest first. One that comes several times in a row is one with a count;
// a cue is one with all that it changes.
function grouped(events) {
  const each = GROUPS_S.find((one) => run.seconds / one <= MOST_GROUPS) ?? GROUPS_S.at(-1), groups = [];
  for (const [at, kind, said] of events) {
    const begun = Math.floor((run.begun + at) / each) * each;
    if (groups[0]?.begun !== begun) groups.unshift({ begun, entries: [] });
    const [last] = groups[0].entries;
    if (last?.kind === kind && last.said.at(-1) === said) last.times += 1;
    else if (last?.kind === kind && at - last.at < TOGETHER_S) last.said.push(said);
    else groups[0].entries.unshift({ at, kind, said: [said], times: 1 });
  }
  return groups;
}

function group({ begun, entries }, place) {
  const whole = document.createElement("details"), head = document.createElement("summary"), list = document.createElement("ul");
  const orders = entries.filter((one) => one.kind === "order").length;
  whole.open = place === 0;
  head.textContent = `${clock(begun)} · ${words("happened_entries", { orders, said: entries.length - orders })}`;
  list.append(...entries.map(entry));
  whole.append(head, list);
  return whole;
}

function entry({ at, kind, said, times }) {
  const item = document.createElement("li"), button = document.createElement("button"), what = document.createElement("small");
  const text = document.createElement("span"), rest = document.createElement("span"), [first, ...others] = said.map(translated);
  button.type = "button";
  button.textContent = exact(run.begun + at);
  button.addEventListener("click", () => point(at));
  what.textContent = words(`happened_${kind}`);
  item.dataset.kind = kind;
  rest.textContent = others.join(" · ");
  text.append(times > 1 ? `${first} ×${times}` : first, rest);
  item.append(button, what, text);
  return item;
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

const draw = () => drawTimeline(byId("timeline"), run, second, stretch());

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
