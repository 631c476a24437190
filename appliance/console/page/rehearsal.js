// For choreographers: the figure with its hands, what is danced, how often a window is coded, how alive it answers.
import { showChoices } from "./choices.js";
import { request } from "./box.js";
import { ask, command, withPin } from "./device.js";
import { byId, every, first } from "./elements.js";
import { Figure } from "./figure.js";
import { initFloor, showFloor } from "./floor.js";
import { initGestures, showGestures } from "./gestures.js";
import { jointName } from "./joints.js";
import { initLearn, leaveLearn, showLearn } from "./learn.js";
import { initMotion, showMotion } from "./motion.js";
import { initSprings, showSprings } from "./springs.js";
import { twice } from "./hold.js";
import { hasWords, number, translated, words } from "./words.js";

const PHRASE_FADE_S = 1, LIVELINESS_FADE_S = 1, KEEPING_MS = 430_000;
const SEEDS = 1_000_000; // six digits are easily noted down
let figure = null, chosen = "phrase";

export function initRehearsal(me, box) {
  first('[data-page="rehearsal"]').hidden = !me.rehearsal;
  for (const id of ["coding", "interaction"]) {
    byId(id).addEventListener("input", () => render());
    byId(id).addEventListener("change", () => {
      const coding = Number(byId("coding").value);
      command("/iterations", coding, Math.min(coding, Number(byId("interaction").value)));
      byId(id).blur();
    });
  }
  byId("liveliness").addEventListener("input", () => render());
  byId("liveliness").addEventListener("change", () => {
    command("/liveliness", Number(byId("liveliness").value), LIVELINESS_FADE_S);
    byId("liveliness").blur();
  });
  byId("seed-new").addEventListener("click", () => command("/seed", Math.floor(Math.random() * SEEDS)));
  byId("rehearsal-parts").append(...[...parts()].map(({ dataset: { part } }) => {
    const button = document.createElement("button");
    button.type = "button";
    button.dataset.opens = part;
    button.textContent = words(`part_${part}`);
    button.addEventListener("click", () => {
      chosen = part;
      showParts();
      button.scrollIntoView({ block: "nearest", inline: "center" });
    });
    return button;
  }));
  figure = new Figure(byId("figure"), byId("figure-said"), box, words);
  initFloor(box);
  initGestures();
  initMotion();
  initSprings();
  initLearn();
  const offerCopy = () => {
    byId("cue-show").hidden = false;
    byId("cue-dance").hidden = !me.installed;
  };
  if (me.cue_kept) offerCopy();
  twice(byId("cue-dance"), danceCopy, "sure_now");
  byId("cue-form").addEventListener("submit", (event) => {
    event.preventDefault();
    withPin(() => keepCue(offerCopy));
  });
}

export function showRehearsal(value, show) {
  figure.show = show;
  byId("figure-how").hidden = figure.joints.length === 0;
  byId("figure-place").hidden = !figure.joints.some((joint) => figure.isPlaced(joint));
  const phrases = value.phrases.map((one) => ({ ...one, label: hasWords(`source_${one.name}`) ? words(`source_${one.name}`) : one.name }));
  showChoices(byId("phrases"), byId("phrases-part"), phrases, (name) => command("/phrase", name, PHRASE_FADE_S));
  const hands = value.hands.map((one) => ({ name: one.joint, title: one.joint, label: `${jointName(one.joint)} · ${one.source === "osc" ? words("hand_here") : one.source}`, now: one.holds }));
  showChoices(byId("hands"), byId("hands-part"), hands, (joint, holds) => command("/hold", joint, holds ? 0 : 1));
  for (const id of ["coding", "interaction"]) {
    if (show) byId(id).max = show.most_iterations;
    if (value.status && document.activeElement !== byId(id)) byId(id).value = value.status[id];
  }
  if (value.status && document.activeElement !== byId("liveliness")) byId("liveliness").value = value.status.liveliness;
  byId("seed-said").textContent = value.status?.seed >= 0 ? words("seed_now", { seed: value.status.seed }) : "";
  render();
  showMotion(value, show);
  showSprings(value, show);
  showFloor(value.goal, show);
  showGestures(value);
  showLearn();
  showParts();
}

const parts = () => every("#rehearsal [data-part]");

// One part at a time, so that the figure stays in view: of those that this show has.
function showParts() {
  const there = [...parts()].filter((part) => [...part.children].some((one) => !(/** @type {HTMLElement} */ (one).hidden)));
  const open = there.find((part) => part.dataset.part === chosen) ?? there[0];
  for (const part of parts()) part.hidden = part !== open;
  for (const button of every("#rehearsal-parts button")) {
    button.hidden = !there.some((part) => part.dataset.part === button.dataset.opens);
    button.setAttribute("aria-pressed", String(button.dataset.opens === open?.dataset.part));
  }
}

// The settings of now become a cue in a copy of the show; what dances stays as it is.
async function keepCue(offerCopy) {
  byId("cue-keep").disabled = true;
  byId("cue-said").textContent = words("change_runs");
  const answer = await request("/api/cue", { name: byId("cue-name").value }, KEEPING_MS);
  byId("cue-keep").disabled = false;
  byId("cue-said").textContent = translated(answer.status === 200 ? answer.value.message : answer.message) || words("no_page");
  if (answer.status === 200) offerCopy();
}

// On an installed box the copy becomes the show, as if it had come on a stick.
async function danceCopy() {
  byId("cue-said").textContent = words("file_checking");
  const answer = await ask("/api/cue/dance", {}, KEEPING_MS);
  const problems = answer.value?.problems?.map((one) => translated(one.message)).join(" ");
  byId("cue-said").textContent = problems || translated(answer.status === 200 ? answer.value.message : answer.message) || words("no_page");
}

// Away from the page no joint is held.
export function leaveRehearsal() {
  figure.letGo();
  leaveLearn();
}

function render() {
  for (const id of ["coding", "interaction"]) byId(`${id}-said`).textContent = byId(id).value;
  byId("liveliness-said").textContent = number(Number(byId("liveliness").value), 2);
}
