// For choreographers: the phrase, how often a window is coded, and which hands hold.
import { showChoices } from "./choices.js";
import { command } from "./device.js";

const byId = (id) => document.getElementById(id);
const PHRASE_FADE_S = 1;

export function initRehearsal(me) {
  document.querySelector('[data-page="rehearsal"]').hidden = !me.rehearsal;
  for (const id of ["coding", "interaction"]) {
    byId(id).addEventListener("input", () => tell());
    byId(id).addEventListener("change", () => {
      const coding = Number(byId("coding").value);
      command("/iterations", coding, Math.min(coding, Number(byId("interaction").value)));
      byId(id).blur();
    });
  }
}

export function showRehearsal(value, show) {
  showChoices(byId("phrases"), byId("phrases-part"), value.phrases, (name) => command("/phrase", name, PHRASE_FADE_S));
  const hands = value.hands.map((one) => ({ name: one.joint, label: `${one.joint} · ${one.who}`, now: one.holds }));
  showChoices(byId("hands"), byId("hands-part"), hands, (joint, holds) => command("/hold", joint, holds ? 0 : 1));
  for (const id of ["coding", "interaction"]) {
    if (show) byId(id).max = show.most_iterations;
    if (value.status && document.activeElement !== byId(id)) byId(id).value = value.status[id];
  }
  tell();
}

function tell() {
  for (const id of ["coding", "interaction"]) byId(`${id}-said`).textContent = byId(id).value;
}
