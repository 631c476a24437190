// Help from afar: one file to send to somebody who can help, and a picture a minute of the night.
import { request } from "./box.js";
import { ask } from "./device.js";
import { byId } from "./elements.js";
import { clock, translated, words } from "./words.js";

const MADE_WITHIN_MS = 150_000;
let pictures = [];

export function initHelp() {
  byId("help-make").addEventListener("click", make);
  byId("night-at").addEventListener("input", showPicture);
}

export async function readNight() {
  const answer = await request("/api/night");
  pictures = answer.status === 200 ? answer.value : [];
  byId("night-part").hidden = answer.status !== 200;
  byId("night-none").hidden = pictures.length > 0;
  byId("night").hidden = byId("night-at").parentElement.hidden = pictures.length === 0;
  byId("night-at").max = Math.max(0, pictures.length - 1);
  byId("night-at").value = pictures.length - 1;
  showPicture();
}

function showPicture() {
  const at = pictures[Number(byId("night-at").value)];
  if (at === undefined) return;
  byId("night").src = `/api/night/${at}.svg`;
  byId("night").alt = byId("night-said").textContent = clock(at);
}

async function make() {
  const say = (sentence) => { byId("help-said").textContent = sentence; };
  byId("help-make").disabled = true;
  say(words("help_makes"));
  const answer = await ask("/api/help", { journal: byId("help-journal").checked }, MADE_WITHIN_MS);
  byId("help-make").disabled = false;
  if (answer.status !== 200) return say(translated(answer.message) || words("no_page"));
  const link = document.createElement("a");
  link.href = "/api/help.zip";
  link.download = answer.value.name;
  link.click();
  return say(words("help_done", answer.value));
}
