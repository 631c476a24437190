// Gestures of the hand that call cues: recorded by making them three times, renamed and forgotten.
import { command } from "./device.js";
import { byId } from "./elements.js";
import { twice } from "./hold.js";
import { words } from "./words.js";

export function initGestures() {
  byId("gesture-form").addEventListener("submit", (event) => {
    event.preventDefault();
    const name = byId("gesture-name").value.trim();
    if (name && byId("gesture-cue").value) command("/gesture/record", name, byId("gesture-cue").value);
  });
  byId("gesture-stop").addEventListener("click", () => command("/gesture/stop"));
}

export function showGestures(value) {
  const gestures = value.gestures ?? {}, list = gestures.list ?? [], cues = value.cues.map((one) => one.name);
  byId("gestures-part").hidden = !value.hands.length || !cues.length;
  const choice = byId("gesture-cue");
  if (choice.dataset.names !== JSON.stringify(cues)) {
    choice.dataset.names = JSON.stringify(cues);
    choice.replaceChildren(...cues.map((name) => new Option(name, name)));
  }
  const recording = gestures.recording;
  byId("gesture-record").disabled = Boolean(recording);
  byId("gesture-stop").hidden = !recording;
  byId("gesture-said").textContent = recording ? words("gesture_come", { name: recording.name, come: recording.come, most: gestures.most }) : gestures.message ?? "";
  const rows = byId("gestures");
  if (rows.dataset.names === JSON.stringify(list)) return;
  rows.dataset.names = JSON.stringify(list);
  rows.replaceChildren(...list.map(row));
}

function row(one) {
  const item = document.createElement("li"), said = document.createElement("span");
  item.className = "row";
  said.textContent = words("gesture_calls", one);
  const button = (key) => {
    const made = document.createElement("button");
    made.type = "button";
    made.textContent = words(key);
    return made;
  };
  const rename = button("gesture_rename"), forget = button("gesture_forget");
  rename.addEventListener("click", () => {
    const name = byId("gesture-name").value.trim();
    if (name) command("/gesture/rename", one.name, name);
    else byId("gesture-name").focus();
  });
  twice(forget, () => command("/gesture/forget", one.name), "sure_now");
  item.append(said, rename, forget);
  return item;
}
