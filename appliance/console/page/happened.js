// The journal: what happened, newest first; its time axis filters the list; any stretch of it can be played again.
import { Dance } from "./dance.js";
import { withPin } from "./device.js";
import { byId } from "./elements.js";
import { drawTimeline, INK, secondAt } from "./timeline.js";
import { clock, day, duration, exact, number, translated, words } from "./words.js";

const HEAD_BYTES = 16, JOINT_BYTES = 32; // a frame's: dance.js
const TOGETHER_S = 0.1; // what a cue changes is noted within one tick
const GROUPS_S = [60, 300, 900, 3600], MOST_GROUPS = 12;
const KINDS = ["fault", "order", "said"], WRONG = ["late", "skipped", "failed"];
const TAPPED = 1 / 12, LEAST_TAPPED_S = 60; // how much of a run a tap on its axis picks

const ORDERS = { look: "look_now", cue: "cue_now", phrase: "phrase_now", master: "master" }; // commands with words of the page

let runs = [], run = null, second = 0, again = null, dance = null;
let entries = [], kind = null, picked = null; // picked: [from, to] seconds of the run

export function initHappened() {
  byId("happened-run").addEventListener("change", () => choose(runs[Number(byId("happened-run").value)]));
  byId("happened-seconds").addEventListener("change", () => point(second));
  byId("happened-read").addEventListener("click", readHappened);
  byId("happened-dance").addEventListener("click", danceAgain);
  byId("happened-whole").addEventListener("click", () => pick(null));
  byId("happened-bunraku").addEventListener("click", (event) => {
    if (document.body.dataset.known === "yes") return;
    event.preventDefault();
    withPin(() => byId("happened-bunraku").click());
  });
  const slider = byId("happened-second"), canvas = byId("timeline");
  slider.addEventListener("input", () => point(Number(slider.value)));
  canvas.addEventListener("click", (event) => {
    const box = canvas.getBoundingClientRect();
    if (!run) return;
    const at = Math.min(Math.max(0, secondAt(run, event.clientX - box.left, box.width)), run.seconds);
    const half = Math.max(LEAST_TAPPED_S, run.seconds * TAPPED) / 2;
    point(at);
    pick(picked && at >= picked[0] && at <= picked[1] ? null : [at - half, at + half]);
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
  entries = [...faults(), ...said()].sort((one, other) => other.at - one.at);
  kind = null;
  point(run.seconds - stretch());
  pick(null);
}

// Ticks that went wrong, as entries of the list: bins that touch are one.
function faults() {
  const found = [];
  run.late.forEach((_, place) => {
    if (!WRONG.some((what) => run[what][place])) return;
    const last = found.at(-1), touches = last?.place === place - 1;
    const one = touches ? last : { at: place * run.bin_s, kind: "fault", times: 1, slowest: 0, late: 0, skipped: 0, failed: 0 };
    one.place = place;
    one.slowest = Math.max(one.slowest, run.slowest_ms[place]);
    for (const what of WRONG) one[what] += run[what][place];
    if (!touches) found.push(one);
  });
  for (const one of found) {
    const counts = WRONG.filter((what) => one[what]).map((what) => counted(`legend_${what}`, one[what]));
    one.said = [counts.join(", "), `${words("legend_slowest")} ${number(one.slowest, 1)} ms`];
  }
  return found;
}

// Commands and messages. One that comes several times in a row is one with a count; a cue is one with all that
// it changes.
function said() {
  const found = [];
  for (const [at, what, sentence] of run.events) {
    const last = found.at(-1);
    if (last?.kind === what && last.said.at(-1) === sentence) last.times += 1;
    else if (last?.kind === what && at - last.at < TOGETHER_S) last.said.push(sentence);
    else found.push({ at, kind: what, said: [sentence], times: 1 });
  }
  return found;
}

// part: [from, to], or null for the whole run.
function pick(part) {
  picked = part;
  byId("happened-picked").hidden = part === null;
  if (part) byId("happened-window").textContent = part.map((at) => exact(run.begun + Math.min(Math.max(0, at), run.seconds))).join(" – ");
  showKinds();
  showEntries();
  draw();
}

const counted = (key, count) => words("happened_count", { kind: words(key), count: number(count) });

const isPicked = ({ at }) => picked === null || (at >= picked[0] && at <= picked[1]);

// How many of each kind, as buttons that show only these. Their colours are those of the axis.
function showKinds() {
  const there = entries.filter(isPicked);
  byId("happened-kinds").replaceChildren(...[null, ...KINDS].map((one) => {
    const button = document.createElement("button"), count = document.createElement("b"), name = document.createElement("span");
    button.type = "button";
    button.dataset.kind = one ?? "all";
    button.setAttribute("aria-pressed", String(kind === one));
    const many = one === null ? there.length : there.filter((found) => found.kind === one).length;
    count.textContent = number(many);
    name.textContent = words(`happened_kind_${one ?? "all"}`);
    if (one) count.style.setProperty("--dot", INK[one]);
    button.dataset.none = String(many === 0);
    button.append(count, name);
    button.addEventListener("click", () => {
      kind = one;
      showKinds();
      showEntries();
    });
    return button;
  }));
}

function showEntries() {
  const shown = entries.filter((one) => isPicked(one) && (kind === null || one.kind === kind));
  byId("happened-none").hidden = shown.length > 0;
  byId("happened-events").replaceChildren(...grouped(shown).map(group));
}

// Entries of the same minutes together, the newest first.
function grouped(shown) {
  const each = GROUPS_S.find((one) => run.seconds / one <= MOST_GROUPS) ?? GROUPS_S.at(-1), groups = [];
  for (const one of shown) {
    const begun = Math.floor((run.begun + one.at) / each) * each;
    if (groups.at(-1)?.begun !== begun) groups.push({ begun, members: [] });
    groups.at(-1).members.push(one);
  }
  return groups;
}

function group({ begun, members }, place) {
  const whole = document.createElement("details"), head = document.createElement("summary"), list = document.createElement("ul");
  whole.open = place === 0 || picked !== null || kind === "fault";
  head.append(clock(begun), ...KINDS.flatMap((what) => {
    const count = document.createElement(what === "fault" ? "b" : "span"), many = members.filter((one) => one.kind === what).length;
    count.textContent = counted(`happened_kind_${what}`, many);
    return many ? [" · ", count] : [];
  }));
  list.append(...members.map(entry));
  whole.append(head, list);
  return whole;
}

function entry({ at, kind: what, said: sentences, times }) {
  const item = document.createElement("li"), button = document.createElement("button"), name = document.createElement("small");
  const text = document.createElement("span"), rest = document.createElement("span"), [first, ...others] = sentences.map(what === "order" ? commanded : translated);
  button.type = "button";
  button.textContent = exact(run.begun + at);
  button.addEventListener("click", () => {
    point(at);
    byId("happened-stretch").scrollIntoView({ block: "nearest" });
  });
  name.textContent = words(`happened_${what}`);
  item.dataset.kind = what;
  item.classList.toggle("refused", sentences.some((one) => one.endsWith("(refused)")));
  rest.textContent = others.join(" · ");
  text.append(times > 1 ? `${first} ×${times}` : first, rest);
  item.append(button, name, text);
  return item;
}

// Such as "Look: veil" and "Master: 80 % · 3 s"; other commands as the journal has them.
function commanded(sentence) {
  const [, name, rest] = /^(\w+) (.+)$/.exec(sentence) ?? [], key = ORDERS[name];
  if (!key) return translated(sentence);
  const level = name === "master" ? rest.replace(/^([\d.]+)(?: ([\d.]+))?/, (_, share, fade) => {
    return [`${number(100 * share)} %`, fade && `${number(Number(fade), fade % 1 ? 1 : 0)} s`].filter(Boolean).join(" · ");
  }) : translated(rest);
  return words("happened_count", { kind: words(key), count: level });
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

const draw = () => drawTimeline(byId("timeline"), run, second, stretch(), picked);

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
  dance.centre = dance.away = dance.tall = null;
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
