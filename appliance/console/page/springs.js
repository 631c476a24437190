// Springs and strings: the setting, how loose, how stormy, how loud, how strongly the strings pull back; a kick.
import { showChoices } from "./choices.js";
import { command } from "./device.js";
import { byId } from "./elements.js";
import { slider } from "./slider.js";
import { number, words } from "./words.js";

const FADE_S = 1;
const KICK_M_S = [1.5, 0.5, 1.5];
// Stiffness is a factor from 0.1 to 10: its slider has powers of ten, so that the setting's own is in the middle.
const DIALS = {
  stiffness: { address: "/springs/stiffness", least: -1, most: 1, digits: 2, given: (at) => 10 ** at, at: Math.log10 },
  storm: { address: "/springs/storm", least: 0, most: 1, digits: 2 },
  feedback: { address: "/springs/feedback", least: 0, most: 1, digits: 2 },
  strings: { address: "/strings", least: 0, most: 1, digits: 2 },
};
const same = (value) => value;

export function initSprings() {
  byId("springs-dials").append(...Object.entries(DIALS).map(([name, dial]) => slider({
    id: `springs-${name}`, label: words(`springs_${name}`), least: dial.least, most: dial.most, step: 0.05,
    onInput: () => showValue(name, dial), act: () => command(dial.address, given(name, dial), FADE_S),
  })));
  byId("springs-kick").addEventListener("click", () => command("/springs/kick", ...KICK_M_S));
}

// Only where springs are among the show's hands, and of strings only where the show has some.
export function showSprings(value, show) {
  byId("springs-part").hidden = !show?.springs?.length;
  if (byId("springs-part").hidden) return;
  const now = value.springs.setting || show.springs[0];
  showChoices(byId("springs"), byId("springs"), show.springs.map((name) => ({ name, now: name === now })), (name) => command("/springs", name, FADE_S));
  const inForce = { stiffness: 1, storm: 0, feedback: show.springs_feedback[now], ...value.springs };
  for (const [name, dial] of Object.entries(DIALS)) {
    const input = byId(`springs-${name}`);
    input.parentElement.hidden = !show.has_strings && ["strings", "feedback"].includes(name);
    if (document.activeElement !== input) input.value = (dial.at ?? same)(inForce[name]);
    showValue(name, dial);
  }
}

function given(name, dial) { return (dial.given ?? same)(Number(byId(`springs-${name}`).value)); }

function showValue(name, dial) { byId(`springs-${name}-said`).textContent = number(given(name, dial), dial.digits); }
