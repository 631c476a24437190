// MIDI: move a control, choose what it does.
import { request } from "./box.js";
import { ask, say } from "./device.js";
import { byId } from "./elements.js";
import { translated, words } from "./words.js";

let targets = [], newest = null, isRead = false;

export function initMidi() {
  byId("midi-command").addEventListener("change", showNames);
  byId("midi-form").addEventListener("submit", (event) => {
    event.preventDefault();
    bind();
  });
}

// The box's newest report: the part is there where the box hears MIDI.
export function showMidi(remote) {
  byId("midi-part").hidden = !remote.bindings;
  if (!remote.bindings) return;
  if (!isRead) read();
  newest = remote.moved ?? null;
  byId("midi-devices").textContent = remote.midi.length ? words("midi_devices", { names: remote.midi.join(", ") }) : words("midi_none");
  byId("midi-moved").textContent = newest ? spoken(newest) : words("midi_move");
  byId("midi-bind").disabled = newest === null;
}

export async function read() {
  isRead = true;
  take(await request("/api/midi"));
}

function take(answer) {
  if (answer.status !== 200) {
    isRead = false;
    return false;
  }
  targets = answer.value.targets;
  const chosen = byId("midi-command").value;
  byId("midi-command").replaceChildren(...targets.map(({ address }) => option(address, address)));
  if (targets.some(({ address }) => address === chosen)) byId("midi-command").value = chosen;
  if (byId("midi-command").value !== chosen) showNames(); // else what is typed there would be lost
  byId("midi-bindings").replaceChildren(...answer.value.bindings.map((one) => {
    const line = document.createElement("li"), text = document.createElement("span"), button = document.createElement("button");
    text.textContent = `${spoken(one)}: ${one.address} ${one.name}`;
    button.type = "button";
    button.textContent = words("midi_remove");
    button.addEventListener("click", () => send("/api/midi/remove", one));
    line.append(text, button);
    return line;
  }));
  return true;
}

function showNames() {
  const { names = [], least = null, most = null } = targets.find(({ address }) => address === byId("midi-command").value) ?? {};
  byId("midi-name-part").hidden = names.length === 0;
  byId("midi-name").replaceChildren(...names.map((name) => option(name, name || words("cue_next"))));
  byId("midi-range-part").hidden = least === null;
  for (const [id, end] of [["midi-low", least], ["midi-high", most]]) Object.assign(byId(id), { min: least, max: most, value: end });
}

function bind() {
  if (newest === null) return;
  const { device, kind, channel, number } = newest, one = { device, kind, channel, number, address: byId("midi-command").value };
  if (!byId("midi-name-part").hidden) Object.assign(one, { name: byId("midi-name").value });
  if (!byId("midi-range-part").hidden) Object.assign(one, { low: Number(byId("midi-low").value), high: Number(byId("midi-high").value) });
  send("/api/midi/bind", one);
}

async function send(path, one) {
  const answer = await ask(path, one);
  if (!take(answer)) say(translated(answer.message) || words("no_page"), true);
}

const spoken = ({ device, kind, channel, number }) => words(`midi_${kind}`, { device, channel, number });

function option(value, text) {
  const one = document.createElement("option");
  Object.assign(one, { value, textContent: text });
  return one;
}
