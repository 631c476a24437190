// A software update, from a stick or from files on this device; a code from the wall confirms it.
import { request } from "./box.js";
import { ask, command } from "./device.js";
import { byId } from "./elements.js";
import { translated, words } from "./words.js";

const COPIED_WITHIN_MS = 120_000;

export function initUpdate() {
  byId("update-file").addEventListener("change", sendFiles);
  byId("update-begin").addEventListener("click", begin);
  byId("update-form").addEventListener("submit", (event) => {
    event.preventDefault();
    confirm();
  });
}

// Only on an installed box that knows its maker's keys, and for a device that gave the PIN.
export async function readUpdate() {
  const answer = await request("/api/update");
  byId("update-part").hidden = answer.status !== 200 || !answer.value.can;
  if (byId("update-part").hidden) return;
  const { stick, ready, installing } = answer.value;
  byId("update-stick").replaceChildren(...stick.map((name) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = words("update_stick", { name });
    button.addEventListener("click", () => take(name));
    return button;
  }));
  if (installing) say(words("update_runs"));
  else show(ready);
}

function show(ready) {
  byId("update-begin").hidden = !ready;
  if (ready) say(words("update_ready", { name: ready }));
}

async function take(name) {
  const answer = await ask("/api/update/stick", { name }, COPIED_WITHIN_MS);
  if (answer.status === 200) show(answer.value.ready);
  else refuse(answer);
}

// One after the other.
async function sendFiles() {
  byId("update-form").hidden = true;
  let ready = null;
  const files = [...byId("update-file").files].sort((one, other) => other.size - one.size);
  byId("update-file").value = ""; // else the same files could not be chosen again after the network was lost
  for (const file of files) {
    const answer = await sent(file, "/api/update/file", say);
    if (answer.status !== 200) return refuse(answer);
    ready = JSON.parse(answer.message).ready;
  }
  if (ready) show(ready);
  else say(words("update_missing"));
  return undefined;
}

// XMLHttpRequest, because fetch does not report the progress of an upload.
export function sent(file, where, report) {
  return new Promise((answered) => {
    const asked = new XMLHttpRequest();
    asked.upload.onprogress = (event) => {
      report(words("update_sends", { name: file.name, percent: Math.floor((100 * event.loaded) / event.total) }));
    };
    asked.onload = () => answered({ status: asked.status, message: asked.responseText });
    asked.onerror = () => answered({ status: 0, message: "" });
    asked.open("POST", `${where}?name=${encodeURIComponent(file.name)}`);
    asked.send(file);
  });
}

async function begin() {
  const answer = await ask("/api/update/begin", {});
  if (answer.status !== 200) return refuse(answer);
  byId("update-form").hidden = false;
  byId("update-code").value = "";
  byId("update-code").focus();
  return command("/projector/info", 1);
}

async function confirm() {
  const answer = await ask("/api/update/confirm", { code: byId("update-code").value });
  if (answer.status !== 200) return refuse(answer);
  byId("update-form").hidden = byId("update-begin").hidden = true;
  return say(words("update_runs"));
}

function refuse(answer) { say(translated(answer.message) || words("no_page")); }

function say(sentence) { byId("update-said").textContent = sentence; }
