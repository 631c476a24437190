// The page: which part is shown, what the box says, and the buttons of the night.
import { readAbout, showClock } from "./about.js";
import { Box } from "./box.js";
import { pictureOfStyle, showChoices } from "./choices.js";
import { goOn, showCues, showTime } from "./cues.js";
import { Dance } from "./dance.js";
import { blackout, command, initDevice, panic } from "./device.js";
import { byId, every, fact, first } from "./elements.js";
import { initFleet } from "./fleet.js";
import { offer } from "./idle.js";
import { initHelp, readNight } from "./help.js";
import { initHappened, readHappened, stopHappened } from "./happened.js";
import { jointName, sourceName } from "./joints.js";
import { initLogs } from "./logs.js";
import { initMidi, read as readMidi, showMidi } from "./midi.js";
import { initPhones } from "./phones.js";
import { initPicture, showPicture } from "./picture.js";
import { initProve, leaveProve, showProve } from "./prove.js";
import { initRehearsal, leaveRehearsal, showRehearsal } from "./rehearsal.js";
import { initRig, showRig } from "./rig.js";
import { initSensorChanges, showSensorChanges } from "./sensor_changes.js";
import { showSensors } from "./sensors.js";
import { initUpdate, readUpdate } from "./update.js";
import { initVenue } from "./venue.js";
import { clock, hasWords, loadWords, locale, number, quoted, translated, words } from "./words.js";

const wide = matchMedia("(min-width: 900px)");
const DAYS = ["mon", "tue", "wed", "thu", "fri", "sat", "sun"]; // as the box says them
const LONG = 75; // letters: more are four lines of a phone
const STILL_PX = 14; // a thumb that scrolls moves farther between touch and release

function show(page) {
  const known = byId(page) && document.querySelector(`[data-page="${page}"]`) ? page : "tonight";
  for (const section of every("main > section")) section.hidden = section.id !== known;
  for (const button of every("nav [data-page]")) {
    if (button.dataset.page === known) button.setAttribute("aria-current", "page");
    else button.removeAttribute("aria-current");
  }
  document.body.dataset.shown = known;
  showMore(known);
  if (location.hash !== `#${known}`) history.replaceState(null, "", `#${known}`);
  scrollTo(0, 0);
  if (known === "happened") readHappened();
  else stopHappened();
  if (known === "box") {
    readAbout();
    readNight();
    readUpdate();
    readMidi();
  }
  if (known === "prove") showProve();
  else leaveProve();
  if (known !== "rehearsal") leaveRehearsal();
  showFrames();
}

// On a phone the pages that no show needs are behind one tab, which names the one that is open.
function showMore(page) {
  const tab = byId("more-pages").querySelector(`[data-page="${page}"]`);
  setText(byId("more-now"), tab?.textContent ?? "");
  if (tab) byId("more").setAttribute("aria-current", "true");
  else byId("more").removeAttribute("aria-current");
  openMore(false);
}

function openMore(isOpen) { byId("more").setAttribute("aria-expanded", String(isOpen)); }

const isMoreOpen = () => byId("more").getAttribute("aria-expanded") === "true";

// On a laptop the dance is beside the cues; a phone spares its battery.
function showFrames() {
  const page = document.body.dataset.shown;
  const isShown = page === "dance" || page === "rehearsal" || (page === "tonight" && wide.matches);
  box.showFrames(isShown && byId("show-dance").checked, page === "dance" && byId("show-ghost").checked);
}

function verdict() {
  const value = box.value;
  if (value === null || box.isSilent) {
    const silent = value !== null || performance.now() > 4000;
    document.body.dataset.level = silent ? "fault" : "waiting";
    byId("verdict").textContent = words(silent ? "no_page" : "waiting");
    document.body.classList.toggle("silent", silent);
    return;
  }
  document.body.classList.remove("silent");
  const { level, key, values } = value.verdict;
  document.body.dataset.level = level;
  const said = { ...values };
  if ("since" in said) said.since = clock(said.since);
  if ("rate" in said) said.rate = number(said.rate, 1);
  if (key === "fallbacks") said.message = beginning(value.fallbacks.find((one) => one.active) ?? said);
  const sentence = words(`verdict_${key}`, said);
  setText(byId("verdict"), sentence);
  byId("verdict").classList.toggle("long", sentence.length > LONG);
}

// In the reader's language, and always by the name of the sensor, receiver, wire or disk that it is about. The box
// says it in English; other languages have a sentence for each fallback.
function spoken({ name, about, message: said }) {
  if (about && hasWords(`named_${name}`)) return quoted(words(`named_${name}`, { about }));
  const sentence = hasWords(`fallback_${name}`) ? quoted(words(`fallback_${name}`)) : translated(said ?? "");
  return about && !sentence.includes(about) ? `${about}: ${sentence}` : sentence;
}

// The first clause: the slot below has the whole sentence.
function beginning(fallback) {
  const sentence = spoken(fallback), lead = `${fallback.about}: `, at = sentence.startsWith(lead) ? lead.length : 0;
  return `${sentence.slice(0, at)}${sentence.slice(at).split(/\s?[.:;] /)[0].replace(/\.$/, "")}.`;
}

function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

// Opening hours, and the projectors that they switch.
function house({ open, next, projectors }) {
  const [day, at] = next?.split(" ") ?? [], date = new Date(Date.UTC(2024, 0, 1 + DAYS.indexOf(day))); // a Monday
  const there = { next: `${date.toLocaleDateString(locale, { weekday: "short", timeZone: "UTC" })} ${at}` };
  const said = next ? words(open ? "hours_open" : "hours_closed", there) : words("hours_always");
  return [["hours", said], ...projectors.map(({ host, state }) => [`${words("projector_power", { host })}`, words(`power_${state}`)])];
}

function tonight(value) {
  const status = value.status;
  const worn = value.sensors.filter((one) => one.is_worn);
  const figures = [
    ["show", status?.show],
    ["state", words(`state_${status?.state ?? "unknown"}`)],
    ["phrase_now", status?.phrase],
    ["sensors", worn.length && words("n_of_m", { n: worn.filter((one) => one.heard).length, m: worn.length })],
    ["rate", status && `${number(status.rate_hz, 1)} Hz`],
    ["late_ticks", status && number(status.late + status.skipped)],
    ["temperature", status?.temperature_c >= 0 && `${number(status.temperature_c)} °C`],
  ].filter(([, said]) => said); // what is not known is left out
  if (value.remote?.state) figures.push(["timecode", `${value.remote.timecode || "–"} · ${words(`code_${value.remote.state}`)}`]);
  if (value.remote?.hours) figures.push(...house(value.remote.hours));
  const list = byId("figures");
  list.replaceChildren(...figures.map(([key, said]) => fact(words(key), said)));
  showMidi(value.remote ?? {});
  showCues(value, dance.show);
  const styles = dance.show?.look_styles ?? {};
  showChoices(byId("looks"), byId("looks-part"), value.looks.map((one) => drawn(one, styles[one.name])), (name) => command("/look", name));
  const cards = value.cards.map((one) => one.name === "none" ? { ...one, label: words("card_none") } : one);
  showChoices(byId("overlays"), byId("overlays-part"), cards, (name) => command("/card", name));
  if (status && document.activeElement !== byId("master")) master(status.panic || status.blackout ? null : status.level);
  byId("stop").setAttribute("aria-pressed", String(status?.state === "stopped"));
  byId("resume").classList.toggle("wanted", ["stopped", "panic"].includes(status?.state ?? ""));
  const over = value.fallbacks.filter((one) => !one.active);
  byId("fallbacks-part").hidden = over.length === 0;
  byId("fallbacks").replaceChildren(...over.map(fallbackItem));
  const active = value.fallbacks.filter((one) => one.active);
  for (const id of ["slot-none", "slot-hands"]) byId(id).hidden = active.length > 0;
  byId("slot-hands").replaceChildren(...value.hands.map((one) => handItem(one, value.sensors)));
  byId("fallbacks-now").replaceChildren(...active.map(fallbackItem));
}

// BLACKOUT and PANIC say what a tap does, and in force how it ends. That the PIN comes first is their lock.
function safety() {
  const { value } = box, status = value?.status;
  for (const act of ["blackout", "panic"]) {
    const isOn = Boolean(status?.[act]);
    byId(act).setAttribute("aria-pressed", String(isOn));
    setText(byId(`${act}-does`), words(value && box.isSilent ? "no_link" : `${act}_${isOn ? "on" : "does"}`));
  }
}

// While nothing is wrong: which joint is held by what, whether it is at this moment, and how full a battery is.
function handItem({ joint, source, holds, is_held: isHeld }, sensors) {
  const item = document.createElement("li"), what = document.createElement("b");
  const [by, state] = ["span", "small"].map((tag) => document.createElement(tag));
  const battery = sensors.find((one) => one.name === source)?.battery ?? null;
  item.dataset.hand = !holds ? "off" : isHeld ? "holds" : "waits";
  what.textContent = jointName(joint);
  what.title = joint;
  by.textContent = sourceName(source);
  state.textContent = [words(`hand_${item.dataset.hand}`), battery === null ? "" : `${battery} %`].filter(Boolean).join(" · ");
  item.append(what, by, state);
  return item;
}

// A look with the picture of its style, and the colours that the show gives it.
function drawn(look, style) {
  if (!style) return look;
  const { style: name, ...colours } = style;
  return { ...look, picture: pictureOfStyle(name), colours: Object.values(colours) };
}

function fallbackItem(fallback) {
  const item = document.createElement("li"), small = document.createElement("small");
  const sentence = spoken(fallback), at = fallback.about ? sentence.indexOf(fallback.about) : -1;
  const about = document.createElement("b");
  about.textContent = at < 0 ? "" : fallback.about;
  item.append(sentence.slice(0, Math.max(at, 0)), about, sentence.slice(at < 0 ? 0 : at + fallback.about.length));
  item.classList.toggle("active", fallback.active);
  small.textContent = words(fallback.active ? "told_now" : "told_before", fallback);
  item.append(small);
  return item;
}

function master(level) {
  if (level !== null) byId("master").value = Math.round(100 * level);
  byId("master-said").textContent = `${byId("master").value} %`;
}

// A press counts when finger or mouse is released where it touched; a thumb that scrolls over it does nothing.
function press(button, act) {
  let from = null;
  button.addEventListener("pointerdown", (event) => { from = [event.clientX, event.clientY]; });
  button.addEventListener("click", (event) => {
    const moved = event.detail && from ? Math.hypot(event.clientX - from[0], event.clientY - from[1]) : 0;
    from = null;
    if (moved <= STILL_PX) act();
  });
}

const me = await fetch("/api/me").then((answer) => answer.json()).catch(() => ({ languages: ["en"] }));
await loadWords(me.languages);
const box = new Box();
const dance = new Dance(byId("stage"), byId("held"), box, words);
const beside = new Dance(byId("tonight-stage"), byId("tonight-held"), box, words);
wide.addEventListener("change", showFrames);
initDevice(me, words);
document.addEventListener("known", () => {
  safety();
  box.reopen(); // as a device with the PIN, which gives way to nobody
});
initPhones();
initPicture();
initHappened();
initProve();
initRig();
initSensorChanges();
initLogs();
initMidi();
initFleet();
initVenue();
initHelp();
initUpdate();
initRehearsal(me, box);
for (const button of every("nav [data-page]")) button.addEventListener("click", () => show(button.dataset.page));
byId("more").addEventListener("click", () => openMore(!isMoreOpen()));
addEventListener("click", (event) => { if (event.target instanceof Node && !first("nav").contains(event.target)) openMore(false); });
first("nav").addEventListener("keydown", (event) => {
  if (event.key !== "Escape" || !isMoreOpen()) return;
  openMore(false);
  byId("more").focus();
});
for (const id of ["show-dance", "show-ghost"]) byId(id).addEventListener("change", () => show("dance"));
byId("show-dance").addEventListener("change", (event) => offer(byId("show-ghost").parentElement, event.target.checked ? "" : words("dance_off")));
addEventListener("hashchange", () => show(location.hash.slice(1)));
for (const button of every("#views button")) {
  const [yaw, pitch] = button.dataset.view.split(" ").map(Number);
  button.addEventListener("click", () => dance.look(yaw, pitch));
  byId("stage").addEventListener("turned", () => button.setAttribute("aria-pressed", String(dance.yaw === yaw && dance.pitch === pitch)));
}
dance.look(0, 0.12); // as the audience sees it
press(byId("go"), goOn);
byId("resume").addEventListener("click", () => command("/go"));
byId("stop").addEventListener("click", () => command("/stop"));
document.addEventListener("keydown", (event) => { // as in other programs for cues
  if (event.key !== " " || event.target !== document.body || document.body.dataset.shown !== "tonight") return;
  event.preventDefault();
  if (!event.repeat) goOn();
});
press(byId("panic"), panic);
press(byId("blackout"), () => blackout(box.value?.status?.blackout ? 0 : 1));
byId("master").addEventListener("input", () => master(null));
byId("master").addEventListener("change", () => {
  command("/master", Number(byId("master").value) / 100, 0.3);
  byId("master").blur();
});
byId("neutral-all").addEventListener("click", () => command("/sensors/neutral"));
byId("heading-all").addEventListener("click", () => command("/sensors/heading"));
box.addEventListener("value", () => {
  tonight(box.value);
  showSensors(byId("cards"), box.value, words);
  showSensorChanges(box.value, dance.show);
  showPicture(box.value);
  showRig(box.value);
  showClock(box.value);
  setText(byId("clock"), [clock(box.value.time), box.value.status?.show, box.value.status?.cue].filter(Boolean).join(" · "));
  showRehearsal(box.value, dance.show);
  dance.follow(box.value);
  beside.follow(box.value);
});
box.addEventListener("value", verdict);
box.addEventListener("beat", verdict);
for (const one of ["value", "beat"]) box.addEventListener(one, safety);
box.addEventListener("beat", () => showTime());
show(location.hash.slice(1) || "tonight");
verdict();
