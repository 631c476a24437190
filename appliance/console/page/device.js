// This device: the PIN, what is asked of the box with it, and the devices that it knows.
import { request } from "./box.js";
import { byId } from "./elements.js";
import { twice } from "./hold.js";
import { date, language, translated } from "./words.js";

let known = false, waiting = null, words = (key) => key, silence = 0;

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
export async function ask(path, said, patience) {
  const answer = await request(path, said, patience);
  if (answer.status !== 401) return answer;
  render(false);
  return new Promise((answered) => askPin(() => answered(ask(path, said, patience)), "", () => answered(answer)));
}

export async function command(address, ...given) {
  const answer = await ask("/api/command", { address, arguments: given });
  const done = answer.status === 200 && answer.value.done;
  say(translated(answer.status === 200 ? answer.value.message : answer.message) || words("no_page"), !done);
  return done;
}

// Never behind a question: while the PIN is asked for something else, PANIC takes its place.
export function panic() {
  return byId("pin").open ? askPin(() => command("/panic"), "pin_panic") : command("/panic");
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
  byId("pin-said").textContent = why && words(why);
  if (!byId("pin").open) {
    byId("pin-input").value = "";
    byId("pin").show(); // not modal: PANIC stays in reach
  }
  byId("pin-input").focus();
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
    byId("pin-said").textContent = words(keys[answer.status] ?? "pin_wrong");
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
  byId("known").textContent = words(known ? "known" : "unknown");
  byId("give-pin").hidden = known;
  byId("devices-part").hidden = !known;
  if (!known) return;
  const answer = await request("/api/devices");
  if (answer.status === 200) byId("devices").replaceChildren(...answer.value.map(listed));
}

function listed(device) {
  const item = document.createElement("li"), since = document.createElement("small"), row = document.createElement("div");
  item.textContent = device.own ? `${device.name} (${words("this_device")})` : device.name;
  since.textContent = date(device.since);
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = words("revoke");
  twice(button, async () => {
    await request("/api/revoke", { id: device.id });
    render(!device.own);
  }, "sure_revoke");
  row.className = "row";
  row.append(button);
  item.append(since, row);
  return item;
}
