// Sensors renamed, replaced, revoked, and a new one paired by cable; each step as the box reports it.
import { say, withPin } from "./device.js";
import { byId } from "./elements.js";
import { translated, words } from "./words.js";

let sensors = [], act = null, name = "";

// For a sensor's row: a button that opens the dialog. what: rename, replace, revoke.
export function changeButton(what, sensor) {
  const button = document.createElement("button");
  button.type = "button";
  button.className = "changes";
  button.textContent = words(what === "revoke" ? "sensor_revoke" : what);
  button.setAttribute("aria-label", `${button.textContent}: ${sensor}`);
  button.addEventListener("click", () => withPin(() => open(what, sensor)));
  return button;
}

export function initSensorChanges() {
  byId("pair").addEventListener("click", () => withPin(() => open("pair", "")));
  byId("change-cancel").addEventListener("click", () => byId("change").close());
  byId("change-spare").addEventListener("change", askAboutWorn);
  byId("change-anyway").addEventListener("change", allowSend);
  byId("change-form").addEventListener("submit", (event) => {
    event.preventDefault();
    send();
  });
}

// Emulated sensors have no keys to change.
export function showSensorChanges(value, show) {
  sensors = value.sensors;
  const isEmulated = Boolean(show?.rehearsal) || !value.control;
  byId("pair").hidden = isEmulated;
  byId("sensors").dataset.emulated = String(isEmulated);
}

function open(what, sensor) {
  [act, name] = [what, sensor];
  byId("change-title").textContent = what === "pair" ? words("pair") : `${words(what === "revoke" ? "sensor_revoke" : what)}: ${sensor}`;
  for (const part of ["name", "spare", "port", "network", "password"]) byId(`change-${part}-part`).hidden = true;
  const parts = { rename: ["name"], replace: ["spare"], revoke: [], pair: ["name", "port", "network", "password"] }[what];
  for (const part of parts) byId(`change-${part}-part`).hidden = false;
  byId("change-spare").replaceChildren(...spares(sensor));
  byId("change-how").textContent = words(what === "replace" && !byId("change-spare").length ? "no_spare" : `${what}_how`);
  byId("change-name").value = what === "rename" ? sensor : "";
  byId("change-password").value = "";
  byId("change-steps").replaceChildren();
  byId("change-send").textContent = words(what === "pair" ? "pair_begin" : what === "revoke" ? "sensor_revoke" : what);
  askAboutWorn();
  byId("change").show(); // not modal: PANIC stays in reach
}

// Spares first, those that send before the others; a sensor that the show wears says so.
function spares(sensor) {
  const others = sensors.filter((one) => one.name !== sensor).sort((one, other) => one.is_worn - other.is_worn || other.heard - one.heard);
  return others.map((one) => new Option(one.is_worn ? words("worn_spare", { name: one.name }) : one.name, one.name));
}

// The sensor that the show loses by this change; "" where it loses none.
function lost() {
  const leaving = { rename: name, revoke: name, replace: byId("change-spare").value }[act] ?? "";
  return sensors.some((one) => one.name === leaving && one.is_worn) ? leaving : "";
}

function askAboutWorn() {
  byId("change-anyway").checked = false;
  byId("change-anyway-part").hidden = !lost();
  byId("change-anyway-words").textContent = words("change_anyway", { name: lost() });
  allowSend();
}

function allowSend() {
  const hasSpare = act !== "replace" || byId("change-spare").length > 0;
  byId("change-send").disabled = !hasSpare || (lost() !== "" && !byId("change-anyway").checked);
}

async function send() {
  const said = { act, name, anyway: byId("change-anyway").checked };
  if (act === "rename") said.new = byId("change-name").value.trim();
  if (act === "replace") said.spare = byId("change-spare").value;
  if (act === "pair") {
    for (const part of ["name", "port", "network", "password"]) said[part] = byId(`change-${part}`).value.trim();
  }
  const button = byId("change-send"), steps = byId("change-steps");
  button.disabled = true;
  steps.replaceChildren(step(words("change_runs"), ""));
  const isDone = await run(said, (sentence) => steps.insertBefore(step(sentence, ""), steps.lastChild));
  steps.lastChild.remove();
  steps.append(step(words(isDone ? "change_done" : "change_failed"), isDone ? "done" : "failed"));
  button.disabled = isDone;
}

async function run(said, report) {
  try {
    const answer = await fetch("/api/sensors", { method: "POST", body: JSON.stringify(said) });
    if (!answer.ok) {
      report(translated(await answer.text()));
      return false;
    }
    const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
    let rest = "", isDone = false;
    for (let part = await reader.read(); !part.done; part = await reader.read()) {
      const lines = (rest + part.value).split("\n");
      rest = lines.pop();
      for (const line of lines.map((one) => JSON.parse(one))) {
        if ("message" in line) report(translated(line.message));
        else isDone = line.done;
      }
    }
    return isDone;
  } catch {
    say(words("no_page"), true);
    return false;
  }
}

function step(sentence, kind) {
  const item = document.createElement("li");
  item.textContent = sentence;
  item.className = kind;
  return item;
}
