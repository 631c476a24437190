// This device: the PIN, what is asked of the box with it, and the devices that it knows.
import { request } from "./box.js";
import { byId, every } from "./elements.js";
import { twice } from "./hold.js";
import { date, language, translated } from "./words.js";

let known = false, waiting = null, silence = 0;
/** @type {(key: string, values?: object) => string} */
let words = (key) => key;

export function initDevice(me, table) {
  words = table;
  render(me.known);
  byId("give-pin").addEventListener("click", () => askPin(null));
  byId("pin-cancel").addEventListener("click", closePin);
  byId("pin").addEventListener("keydown", (event) => { if (event.key === "Escape") closePin(); });
  byId("pin-form").addEventListener("submit", (event) => {
    event.preventDefault();
    givePin();
  });
  byId("languages").replaceChildren(...me.languages.map((one) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = new Intl.DisplayNames([one], { type: "language" }).of(one);
    button.lang = one;
    button.setAttribute("aria-pressed", String(one === language));
    button.addEventListener("click", () => {
      localStorage.setItem("language", one);
      location.reload();
    });
    return button;
  }));
}

// Ask the box for something; a device that it does not know gives the PIN first, and then it is done at once. Where the
// PIN is not given, the answer is that it is needed.
// why: what the question says of it.
export async function ask(path, said, patience = undefined, why = "") {
  const answer = await request(path, said, patience);
  if (answer.status !== 401) return answer;
  render(false);
  return new Promise((answered) => askPin(() => answered(ask(path, said, patience)), why, () => answered(answer)));
}

export const command = (address, ...given) => sent(address, given);

async function sent(address, given, why = "") {
  const answer = await ask("/api/command", { address, arguments: given }, undefined, why);
  const done = answer.status === 200 && answer.value.done;
  say(translated(answer.status === 200 ? answer.value.message : answer.message) || words("no_page"), !done);
  return done;
}

// Never behind a question: while the PIN is asked for something else, these two take its place.
export const panic = () => urgent("/panic", [], "panic");
export const blackout = (wanted) => urgent("/blackout", [wanted], "blackout");

function urgent(address, given, name) {
  const why = words("pin_follows", { what: words(name) });
  return byId("pin").open ? askPin(() => command(address, ...given), why) : sent(address, given, why);
}

// Do something that needs the PIN, which a device that is not known gives first.
export function withPin(then) {
  if (known) then();
  else askPin(then);
}

const LONG = 90; // letters: more are three lines of a phone

export function say(sentence, refused = false) {
  const said = byId("said");
  said.textContent = sentence;
  said.classList.toggle("refused", refused);
  said.classList.toggle("long", sentence?.length > LONG);
  clearTimeout(silence);
  silence = setTimeout(() => { said.textContent = ""; }, refused ? 8000 : 3000);
}

function askPin(then, why = "", instead = () => {}) {
  const before = waiting;
  waiting = { then, instead };
  before?.instead();
  sayOfPin(why, true);
  if (!byId("pin").open) {
    byId("pin-input").value = "";
    byId("pin").show(); // not modal: PANIC stays in reach
  }
  byId("pin-input").focus();
}

function sayOfPin(sentence, isWhy = false) {
  byId("pin-said").textContent = sentence;
  byId("pin-said").classList.toggle("why", isWhy);
}

function closePin() {
  const before = waiting;
  waiting = null;
  byId("pin").close();
  before?.instead();
}

async function givePin() {
  byId("pin-send").disabled = true;
  const answer = await request("/api/pin", { pin: byId("pin-input").value, name: deviceName() });
  byId("pin-send").disabled = false;
  if (answer.status !== 200) {
    const keys = { 403: "pin_wrong", 429: "pin_wait", 0: "no_page" };
    sayOfPin(words(keys[answer.status] ?? "pin_wrong"));
    byId("pin-input").select();
    return;
  }
  byId("pin").close();
  render(true);
  document.dispatchEvent(new Event("known"));
  const given = waiting;
  waiting = null;
  given?.then?.();
}

// Such as "iPhone, Safari" or "Linux, Chrome": enough to tell the devices in a list apart.
function deviceName() {
  const said = navigator.userAgent;
  const machine = ["iPhone", "iPad", "Android", "Windows", "Macintosh", "Linux"].find((one) => said.includes(one));
  const browser = ["Firefox", "Edg", "Chrome", "Safari"].find((one) => said.includes(one));
  return [machine, browser].filter(Boolean).join(", ");
}

async function render(isKnown) {
  known = isKnown;
  document.body.dataset.known = known ? "yes" : "no";
  for (const one of every("[data-locks]")) one.ariaDescription = known ? null : words("asks_pin"); // its lock is a picture
  byId("known").textContent = words(known ? "known" : "unknown");
  byId("own-name").textContent = deviceName();
  byId("own-since").textContent = "";
  byId("give-pin").hidden = known;
  byId("devices-part").hidden = byId("own-part").hidden = true;
  if (!known) return;
  const answer = await request("/api/devices");
  if (answer.status !== 200) return;
  const own = answer.value.find((one) => one.own), others = answer.value.filter((one) => !one.own);
  byId("devices-part").hidden = others.length === 0;
  byId("devices").replaceChildren(...others.map(listed));
  byId("own-part").hidden = !own;
  if (!own) return;
  byId("own-name").textContent = own.name;
  byId("own-since").textContent = words("pin_given", { time: date(own.since) });
  byId("own-part").replaceChildren(revoking(own, "revoke_own"));
}

function listed(device) {
  const item = document.createElement("li"), name = document.createElement("b"), since = document.createElement("small");
  name.textContent = device.name;
  since.textContent = words("pin_given", { time: date(device.since) });
  item.append(name, since, revoking(device, "revoke"));
  return item;
}

function revoking(device, key) {
  const button = document.createElement("button");
  button.type = "button";
  button.className = "danger";
  button.textContent = words(key);
  button.setAttribute("aria-label", `${words(key)}: ${device.name}`);
  twice(button, async () => {
    await request("/api/revoke", { id: device.id });
    render(!device.own);
  }, "sure_revoke");
  return button;
}
