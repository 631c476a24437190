// Changes that a venue makes to its box: keys of the box file, the file as a whole, and which show dances.
import { ask } from "./device.js";
import { breakable, byId } from "./elements.js";
import { twice } from "./hold.js";
import { translated, words } from "./words.js";

const CHECKED_WITHIN_MS = 430_000;
const RECEIVERS = ["outputs", "osc"];
const NEW_RECEIVER = { host: "192.168.0.20", port: 9004 };
let file = null, asked = "", receivers = [];

export function initVenue() {
  byId("file-read").addEventListener("click", readFile);
  byId("file-check").addEventListener("click", () => save(false));
  byId("file-add").addEventListener("click", addReceiver);
  byId("file-part").addEventListener("input", showChanges);
  twice(byId("file-now"), () => save(true), "sure_now");
}

export async function danceAgain(id) {
  byId("box-said").textContent = words("file_checking");
  const answer = await ask("/api/box/show", { id }, CHECKED_WITHIN_MS);
  byId("box-said").textContent = translated(answer.status === 200 ? answer.value.message : answer.message) || words("no_page");
}

async function readFile() {
  showSentence(words("box_reading"), []);
  const answer = await ask("/api/box/file", undefined, CHECKED_WITHIN_MS);
  byId("file-part").hidden = answer.status !== 200;
  if (answer.status !== 200) return showSentence(translated(answer.message) || words("no_page"), []);
  file = answer.value;
  receivers = file.receivers.map((written) => ({ written, removed: false, added: false }));
  byId("file-name").replaceChildren(...breakable(file.file));
  byId("file-text").value = file.text;
  byId("file-now").hidden = !file.at_once;
  byId("file-check").textContent = words(file.at_once ? "file_later" : "file_write");
  const isReceiver = ({ location }) => location[0] === RECEIVERS[0] && location[1] === RECEIVERS[1];
  byId("file-keys").replaceChildren(...groupsOf(file.keys.filter((key) => !isReceiver(key))));
  showReceivers();
  return showSentence("", []);
}

// In the reader's language.
function labelOf(location) {
  const [group, list, place, key] = location;
  if (group === "outputs") return `${words(`list_${list}`, { n: place + 1 })}: ${words(`key_${key}`)}`;
  return words(`key_${location.join("_")}`);
}

const dotted = (location) => location.reduce((said, step) => typeof step === "number" ? `${said}[${step}]` : said ? `${said}.${step}` : step, "");

// Keys of one part of the box fold together; the part is what their labels have before the colon.
function groupsOf(keys) {
  const groups = new Map();
  for (const key of keys) {
    const name = key.location.slice(0, key.location[0] === "outputs" ? 3 : 1).join(".");
    groups.set(name, [...groups.get(name) ?? [], key]);
  }
  return [...groups.values()].map((members, place) => {
    const group = document.createElement("details"), head = document.createElement("summary"), count = document.createElement("small");
    const [, title] = /^(.+?)\s?: /.exec(labelOf(members[0].location)) ?? [];
    group.open = place === 0 || matchMedia("(min-width: 900px)").matches;
    head.append(title ?? members[0].location[0], " ", count);
    group.append(head, ...members.map(field));
    return group;
  });
}

// Label, value, its bounds; what it is for opens on a tap, with the key for those who edit the file.
function field(key) {
  const whole = document.createElement("div"), label = document.createElement("label"), name = document.createElement("span");
  const input = document.createElement("input"), bounds = document.createElement("span"), was = document.createElement("small");
  const why = document.createElement("small"), help = document.createElement("button");
  const said = labelOf(key.location).replace(/^.+?\s?: /, "");
  name.textContent = said.charAt(0).toUpperCase() + said.slice(1);
  input.type = key.kind === "switch" ? "checkbox" : "text";
  if (key.kind === "number") input.inputMode = "numeric";
  if (key.kind === "switch") input.checked = key.value;
  else input.value = key.kind === "list" ? key.value.join(", ") : key.value ?? "";
  plain(input, key.location);
  bounds.className = "bounds";
  bounds.textContent = key.kind === "number" ? translated(key.within) : "";
  was.className = "was";
  const within = key.within && key.kind !== "number" ? ` (${translated(key.within)})` : "";
  why.textContent = `${translated(key.purpose)}${within} · ${dotted(key.location)}`;
  why.hidden = true;
  help.type = "button";
  help.className = "help";
  help.textContent = "?";
  help.setAttribute("aria-label", `${words("file_help")}: ${labelOf(key.location)}`);
  help.setAttribute("aria-expanded", "false");
  help.addEventListener("click", () => {
    why.hidden = !why.hidden;
    help.setAttribute("aria-expanded", String(!why.hidden));
  });
  label.append(name, input, bounds, was);
  whole.className = "venue-field";
  label.className = "venue-key";
  label.dataset.kind = key.kind;
  whole.append(label, help, why);
  return whole;
}

// Marks the fields that differ from the file; the head of a group and the bar of buttons count them.
function showChanges() {
  for (const input of keyInputs()) {
    const key = keyOf(input), differs = JSON.stringify(typed(key, input)) !== JSON.stringify(key.value);
    const label = input.closest("label"), before = Array.isArray(key.value) ? key.value.join(", ") : key.value;
    label.classList.toggle("changed", differs);
    label.querySelector(".was").textContent = !differs ? "" : key.kind === "switch" || before === "" || before === null
      ? words("file_changed") : words("file_was", { value: before });
  }
  const rows = [...byId("file-receivers").children];
  receivers.forEach((one, place) => {
    const differs = one.added || one.removed || Object.entries(one.typed ?? {}).some(([key, value]) => plainNumber(value) !== one.written[key]);
    rows[place].classList.toggle("changed", differs);
  });
  for (const group of byId("file-keys").children) {
    const count = group.querySelectorAll(".changed").length;
    group.querySelector("summary small").textContent = count ? words("file_changes", { count }) : "";
  }
  const all = document.querySelectorAll("#file-part .changed").length + Number(byId("file-text").value !== file.text);
  byId("file-bar").dataset.changes = all;
  byId("file-changes").textContent = all ? words("file_changes", { count: all }) : "";
}

const keyInputs = () => /** @type {HTMLInputElement[]} */ ([...byId("file-keys").querySelectorAll("input")]);
const keyOf = (input) => file.keys.find((key) => key.location.join(".") === input.name);

function plain(input, location) {
  input.autocomplete = "off";
  input.spellcheck = false;
  input.setAttribute("autocapitalize", "off");
  input.name = location.join(".");
  input.dataset.key = dotted(location);
}

function showReceivers() {
  byId("file-receivers").replaceChildren(...receivers.map((one, place) => {
    const row = document.createElement("fieldset"), legend = document.createElement("legend"), button = document.createElement("button");
    legend.textContent = words("list_osc", { n: place + 1 });
    const inputs = ["host", "port"].map((key) => {
      const label = document.createElement("label"), name = document.createElement("span"), input = document.createElement("input");
      name.textContent = words(`key_${key}`);
      plain(input, [...RECEIVERS, place, key]);
      input.value = one.typed?.[key] ?? one.written[key] ?? "";
      input.disabled = one.removed;
      input.addEventListener("input", () => { one.typed = { ...one.typed, [key]: input.value.trim() }; });
      label.className = "venue-key";
      label.append(name, input);
      return label;
    });
    button.type = "button";
    button.textContent = words(one.removed ? "undo" : "file_remove");
    button.addEventListener("click", () => {
      if (one.added) receivers.splice(place, 1);
      else one.removed = !one.removed;
      showReceivers();
    });
    const small = document.createElement("small");
    small.textContent = one.removed ? words("file_removed") : [one.written.dialect, one.written.program].filter(Boolean).join(" · ");
    row.classList.toggle("removed", one.removed);
    row.append(legend, ...inputs, button, small);
    return row;
  }));
  showChanges();
}

function addReceiver() {
  receivers.push({ written: { ...NEW_RECEIVER }, removed: false, added: true });
  showReceivers();
  /** @type {HTMLInputElement} */ (byId("file-receivers").lastElementChild.querySelector("input")).select();
}

// Only what was changed: what the file leaves out stays out. A list of receivers is written as a whole where one was
// added or removed; comments inside of it go then.
function changed() {
  const found = keyInputs().flatMap((input) => {
    const key = keyOf(input), value = typed(key, input);
    return JSON.stringify(value) === JSON.stringify(key.value) ? [] : [[key.location, value]];
  });
  const entry = ({ written, typed: said = {} }) => ({ ...written, ...Object.fromEntries(Object.entries(said).map(([key, value]) => [key, plainNumber(value)])) });
  if (receivers.some((one) => one.added || one.removed)) {
    return [...found, [RECEIVERS, receivers.filter((one) => !one.removed).map(entry)]];
  }
  const edited = receivers.flatMap((one, place) => Object.entries(one.typed ?? {}).flatMap(([key, value]) => {
    const wanted = plainNumber(value);
    return wanted === one.written[key] ? [] : [[[...RECEIVERS, place, key], wanted]];
  }));
  const whole = edited.length && !file.receivers_written ? [[RECEIVERS, receivers.map(entry)]] : edited;
  return [...found, ...whole];
}

const plainNumber = (said) => said !== "" && Number.isFinite(Number(said)) ? Number(said) : said;

function typed(key, input) {
  if (key.kind === "switch") return input.checked;
  const said = input.value.trim();
  if (key.kind === "list") return said ? said.split(",").map((one) => one.trim()) : [];
  if (key.kind === "number") return plainNumber(said);
  return said === "" && key.value === null ? null : said;
}

async function save(now) {
  showSentence(words("file_checking"), []);
  const buttons = [byId("file-check"), byId("file-now")];
  for (const button of buttons) button.disabled = true;
  const wanted = { text: byId("file-text").value, values: changed(), now, read: file.text };
  const sure = asked === JSON.stringify(wanted);  // the same once more answers its questions
  asked = "";
  const answer = await ask("/api/box/file", { ...wanted, sure }, CHECKED_WITHIN_MS);
  for (const button of buttons) button.disabled = false;
  if (answer.status !== 200) return showSentence(translated(answer.message) || words("no_page"), []);
  const { problems, asks, message: said } = answer.value;
  if (problems.length) return showSentence(words("file_refused"), problems, wanted.values);
  if (asks) {
    asked = JSON.stringify(wanted);
    return showSentence(words("file_sure"), asks.map((one) => ({ message: one })));
  }
  if (now) file.text = null; // the box starts anew: what it has now is this device's own change
  else await readFile();
  return showSentence(translated(said), []);
}

// A problem names its key, or repeats the value that was typed: that field is marked, and says what is wrong.
function showSentence(sentence, problems, values = []) {
  byId("file-said").textContent = sentence;
  for (const input of document.querySelectorAll("#file-part input")) input.removeAttribute("aria-invalid");
  for (const note of document.querySelectorAll("#file-part .wrong")) note.remove();
  byId("file-problems").replaceChildren(...problems.map((one) => {
    const item = document.createElement("li"), said = translated(one.message), input = fieldOf(one.message, values);
    item.textContent = one.line && !input ? `${words("file_line", one)} ${said}` : said;
    if (input) mark(input, said);
    return item;
  }));
  document.querySelector("#file-part [aria-invalid]")?.scrollIntoView({ block: "center" });
}

function fieldOf(said, values) {
  const inputs = /** @type {HTMLInputElement[]} */ ([...document.querySelectorAll("#file-part input")]);
  const quoted = /'([^']*)'/.exec(said)?.[1];
  const named = inputs.find((input) => input.dataset.key && input.dataset.key === quoted);
  if (named || !quoted) return named;
  return inputs.find((input) => input.value.split(",").some((one) => one.trim() === quoted) && values.length > 0);
}

function mark(input, said) {
  const note = document.createElement("small");
  note.className = "wrong";
  note.textContent = said;
  input.setAttribute("aria-invalid", "true");
  input.closest("label").append(note);
  const group = input.closest("details");
  if (group) group.open = true;
}
