// The boxes in this network: verdict, show and release of each, with a link to its page; this box's show goes to others.
import { ask, say } from "./device.js";
import { byId } from "./elements.js";
import { twice } from "./hold.js";
import { clock, number, translated, words } from "./words.js";

const SENT_WITHIN_MS = 1_000_000; // a show is sent, then checked over there

export function initFleet() {
  byId("fleet-read").addEventListener("click", async () => {
    byId("fleet-said").textContent = words("fleet_reading");
    byId("fleet-push").hidden = true;
    const answer = await ask("/api/fleet", undefined, 15000);
    byId("fleet-said").textContent = "";
    if (answer.status !== 200) return say(translated(answer.message) || words("no_page"), true);
    if (answer.value.length === 0) byId("fleet-said").textContent = words("fleet_none");
    byId("fleet").replaceChildren(...answer.value.map(shown));
    byId("fleet-push").hidden = !answer.value.some((one) => one.verdict);
    return undefined;
  });
  twice(byId("fleet-push"), () => {
    const ticked = [...byId("fleet").children].filter((line) => line.querySelector("[type=checkbox]").checked);
    byId("fleet-said").textContent = ticked.length ? "" : words("fleet_tick");
    return Promise.all(ticked.map(push));
  }, "sure_push");
}

// A box that does not know this one yet asks for its PIN: the field stays until it is the right one.
async function push(line) {
  const [pin, said] = [line.querySelector(".pin"), line.querySelector("output")];
  said.textContent = words("fleet_sending");
  const answer = await ask("/api/fleet/push", { host: line.dataset.host, pin: pin.value }, SENT_WITHIN_MS);
  const { state, message } = answer.status === 200 ? answer.value : { state: "refused", message: answer.message };
  pin.hidden = state !== "pin";
  said.textContent = [words(`fleet_${state}`), translated(message)].filter(Boolean).join(" ");
}

function shown({ host, origin, version, show, cue, verdict }) {
  const line = document.createElement("li"), link = document.createElement("a"), small = document.createElement("small");
  const tick = document.createElement("input"), pin = document.createElement("input"), said = document.createElement("output");
  Object.assign(link, { href: origin, textContent: host });
  Object.assign(tick, { type: "checkbox", disabled: !verdict, ariaLabel: host });
  Object.assign(pin, { className: "pin", hidden: true, inputMode: "numeric", autocomplete: "off", ariaLabel: words("fleet_pin_of", { host }), placeholder: "PIN" });
  line.dataset.level = verdict?.level ?? "fault";
  line.dataset.host = host;
  small.textContent = [verdict ? spoken(verdict) : words("fleet_silent"), show, cue, version].filter(Boolean).join(" · ");
  line.append(tick, link, small, pin, said);
  return line;
}

function spoken({ key, values }) {
  const said = { ...values };
  if ("since" in said) said.since = clock(said.since);
  if ("rate" in said) said.rate = number(said.rate, 1);
  if ("message" in said) said.message = translated(said.message);
  return words(`verdict_${key}`, said);
}
