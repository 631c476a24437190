// The boxes in this network: verdict, show and release of each, with a link to its page.
import { ask, say } from "./device.js";
import { byId } from "./elements.js";
import { clock, number, translated, words } from "./words.js";

export function initFleet() {
  byId("fleet-read").addEventListener("click", async () => {
    byId("fleet-said").textContent = words("fleet_reading");
    const answer = await ask("/api/fleet", undefined, 15000);
    byId("fleet-said").textContent = "";
    if (answer.status !== 200) return say(translated(answer.message) || words("no_page"), true);
    if (answer.value.length === 0) byId("fleet-said").textContent = words("fleet_none");
    byId("fleet").replaceChildren(...answer.value.map(shown));
    return undefined;
  });
}

function shown({ host, origin, version, show, cue, verdict }) {
  const line = document.createElement("li"), link = document.createElement("a"), small = document.createElement("small");
  Object.assign(link, { href: origin, textContent: host });
  line.dataset.level = verdict?.level ?? "fault";
  small.textContent = [verdict ? spoken(verdict) : words("fleet_silent"), show, cue, version].filter(Boolean).join(" · ");
  line.append(link, small);
  return line;
}

function spoken({ key, values }) {
  const said = { ...values };
  if ("since" in said) said.since = clock(said.since);
  if ("rate" in said) said.rate = number(said.rate, 1);
  return words(`verdict_${key}`, said);
}
