// A phone as a sensor: which one, where it is worn, then the lamp of a wearable as colours.
import { request } from "./box.js";
import { byId, every } from "./elements.js";
import { PhoneLink } from "./phone_link.js";
import { loadWords, translated, words } from "./words.js";

const FIRST_EVENT_MS = 2000;
const LOOK_MS = 250;
const AGAIN_MS = 1500;
const KEPT = "phone"; // in this browser: {where, passes: {name: pass}}

const kept = { where: "left-arm", passes: {}, ...read() };
let name = "", code = "", link = null, isWanted = false, isJoining = false, wakeLock = null, battery, newest = null;

const me = await fetch("/api/me").then((answer) => answer.json()).catch(() => ({ languages: ["en"] }));
await loadWords(me.languages);
const sensors = (await request("/api/phones")).value ?? [];
readAddress();
showChoice();

function read() {
  try {
    return JSON.parse(localStorage.getItem(KEPT)) ?? {};
  } catch {
    return {};
  }
}

function keep() {
  try {
    localStorage.setItem(KEPT, JSON.stringify(kept));
  } catch { /* a private window keeps nothing: a reload asks again */ }
}

// #NAME=CODE, as the QR code has it. The code is for one phone: it leaves the address when it was used.
function readAddress() {
  const [given, secret] = location.hash.slice(1).split("=").map(decodeURIComponent);
  const names = sensors.map((one) => one.name);
  name = names.includes(given) ? given : names.length === 1 ? names[0] : "";
  code = secret ?? "";
}

function showChoice() {
  const buttons = sensors.map((one) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = one.name;
    button.setAttribute("aria-pressed", String(one.name === name));
    button.addEventListener("click", () => { name = one.name; showChoice(); });
    return button;
  });
  byId("names").replaceChildren(...buttons);
  byId("names").hidden = sensors.length < 2;
  for (const button of every("#places button")) button.setAttribute("aria-pressed", String(button.dataset.where === kept.where));
  byId("how").textContent = words(`phone_how_${kept.where}`);
  const needsPin = !me.known && !code && !kept.passes[name];
  byId("pin-part").hidden = !needsPin || !name;
  byId("trust").hidden = location.protocol !== "https:";
  const obstacle = !sensors.length ? "phone_none" : !isSecureContext ? "phone_insecure" : !name ? "phone_choose" : "";
  byId("begin").disabled = obstacle !== "";
  say(obstacle && words(obstacle));
}

function say(sentence) { byId("phone-said").textContent = sentence; }

// iOS asks the user, and only within a tap: this comes before anything that waits.
async function isAllowed() {
  /** @type {any[]} */
  const kinds = [globalThis.DeviceOrientationEvent, globalThis.DeviceMotionEvent];
  const asking = kinds.filter((kind) => typeof kind?.requestPermission === "function").map((kind) => kind.requestPermission());
  try {
    return (await Promise.all(asking)).every((answer) => answer === "granted");
  } catch {
    return false;
  }
}

function listen() {
  addEventListener("deviceorientation", turn);
  addEventListener("devicemotion", () => link?.noteSign());
}

// The angles are about the axes of the phone and not of its screen, so a rotated screen changes nothing.
function turn({ alpha, beta, gamma }) {
  if (![alpha, beta, gamma].every(Number.isFinite)) return;
  newest = [alpha, beta, gamma];
  link?.take(newest);
}

async function begin(takeOver = false) {
  byId("begin").disabled = true;
  byId("take-over").hidden = true;
  say(words("phone_waits"));
  const allowed = await isAllowed();
  byId("begin").disabled = false;
  if (!allowed) return say(words("phone_denied"));
  listen();
  if (!await within(FIRST_EVENT_MS, () => newest)) return say(words("phone_no_motion"));
  if (!byId("pin-part").hidden && !await givePin()) return undefined;
  if (!await join(takeOver)) return undefined;
  isWanted = true;
  byId("start").hidden = true;
  byId("worn").hidden = false;
  byId("worn-name").textContent = name;
  document.documentElement.requestFullscreen?.().catch(() => {});
  stayAwake();
  readBattery();
  return undefined;
}

async function within(patience, found) {
  const until = performance.now() + patience;
  while (!found() && performance.now() < until) await new Promise((over) => setTimeout(over, 20));
  return found();
}

async function givePin() {
  const answer = await request("/api/pin", { pin: byId("phone-pin").value, name: `${words("phone_device")} ${name}` });
  if (answer.status === 200) {
    me.known = true;
    byId("pin-part").hidden = true;
    return true;
  }
  say(words({ 429: "pin_wait", 0: "no_page" }[answer.status] ?? "pin_wrong"));
  return false;
}

async function join(takeOver) {
  const said = { name, where: kept.where, code, pass: kept.passes[name], take_over: takeOver };
  const answer = await request("/api/phones/join", said);
  if (answer.status !== 200) {
    if (answer.status === 401 || answer.status === 403) {
      code = "";
      delete kept.passes[name];
      byId("pin-part").hidden = false;
    }
    byId("take-over").hidden = answer.status !== 409;
    const keys = { 0: "no_page", 401: "phone_code_missing", 403: "phone_code_wrong", 409: "phone_taken", 429: "pin_wait" };
    say(keys[answer.status] ? words(keys[answer.status], { name }) : translated(answer.message));
    return false;
  }
  if (answer.value.pass) kept.passes[name] = answer.value.pass;
  code = "";
  keep();
  history.replaceState(null, "", `#${encodeURIComponent(name)}`);
  say("");
  link?.close();
  link = new PhoneLink(answer.value.session);
  link.battery = battery;
  link.addEventListener("answer", (event) => show(event.detail));
  link.addEventListener("lost", lose);
  if (newest) link.take(newest);
  return true;
}

// Another phone took the place, or this one was away: it comes back by itself where nobody else is there.
async function lose() {
  link = null;
  await rejoin();
}

async function rejoin() {
  if (!isWanted || isJoining || document.visibilityState !== "visible") return;
  isJoining = true;
  const joined = await join(false);
  isJoining = false;
  if (joined) return;
  if (byId("phone-said").textContent === words("no_page")) setTimeout(rejoin, AGAIN_MS);
  else end();
}

function end() {
  isWanted = false;
  link?.close();
  link = null;
  wakeLock?.release();
  wakeLock = null;
  document.body.dataset.lamp = "none";
  byId("worn").hidden = true;
  byId("start").hidden = false;
  if (document.fullscreenElement) document.exitFullscreen();
}

// The words and colours of a wearable's lamp: docs/dancer.md.
function show({ lamp, linked, said }) {
  light(link.isStill ? "still" : linked ? lamp : "looking");
  byId("trouble").textContent = said ? words(`phone_${said}`) : "";
}

function light(lamp) {
  if (document.body.dataset.lamp === lamp) return;
  document.body.dataset.lamp = lamp;
  byId("lamp-said").textContent = words(`phone_lamp_${lamp}`);
}

async function stayAwake() {
  try {
    wakeLock = await navigator.wakeLock?.request("screen") ?? null;
  } catch {
    wakeLock = null; // low battery: the phone decides
  }
  byId("awake").hidden = wakeLock !== null;
}

async function readBattery() {
  const found = await /** @type {any} */ (navigator).getBattery?.().catch(() => null);
  if (!found) return;
  const note = () => {
    battery = Math.round(100 * found.level);
    if (link) link.battery = battery;
  };
  found.addEventListener("levelchange", note);
  note();
}

// A page that is not seen gets no motion, and the phone's heading may be another one afterwards: it leaves, and is
// switched on again when it comes back.
function sleep() {
  link?.close();
  link = null;
}

function wake() {
  if (!isWanted || document.visibilityState !== "visible") return;
  stayAwake();
  if (!link) rejoin();
}

for (const button of every("#places button")) {
  button.addEventListener("click", () => {
    kept.where = button.dataset.where;
    keep();
    showChoice();
  });
}
byId("begin-form").addEventListener("submit", (event) => {
  event.preventDefault();
  begin();
});
byId("take-over").addEventListener("click", () => begin(true));
byId("neutral-pose").addEventListener("click", () => link?.tap());
byId("end").addEventListener("click", () => { end(); showChoice(); });
addEventListener("hashchange", () => { readAddress(); showChoice(); });
addEventListener("pagehide", sleep);
addEventListener("pageshow", wake);
document.addEventListener("visibilitychange", () => { if (document.visibilityState === "visible") wake(); else sleep(); });
setInterval(() => {
  if (isWanted && (!link || link.isSilent)) light("away");
}, LOOK_MS);
