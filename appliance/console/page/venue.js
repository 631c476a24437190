// What a venue changes of its box: keys of the box file, the file as a whole, and which show dances.
import { ask } from "./device.js";
import { byId } from "./elements.js";
import { words } from "./words.js";

const SURE_MS = 6000, CHECKED_WITHIN_MS = 100_000;
let file = null, asked = "";

export function initVenue() {
  byId("file-read").addEventListener("click", readFile);
  byId("file-check").addEventListener("click", () => save(false));
  twice(byId("file-now"), () => save(true), "sure_now");
}

// A button that stops the show asks once more, in its own place.
export function twice(button, act, key) {
  let timer = 0, own = "";
  const calm = () => {
    clearTimeout(timer);
    timer = 0;
    button.textContent = own;
  };
  button.addEventListener("click", () => {
    if (timer) {
      calm();
      act();
      return;
    }
    own = button.textContent;
    button.textContent = words(key);
    timer = setTimeout(calm, SURE_MS);
  });
}

export async function danceAgain(id) {
  byId("box-said").textContent = words("file_checking");
  const answer = await ask("/api/box/show", { id }, CHECKED_WITHIN_MS);
  byId("box-said").textContent = answer.status === 200 ? answer.value.words : answer.words || words("no_page");
}

async function readFile() {
  tell(words("box_reading"), []);
  const answer = await ask("/api/box/file", undefined, CHECKED_WITHIN_MS);
  byId("file-part").hidden = answer.status !== 200;
  if (answer.status !== 200) return tell(answer.words || words("no_page"), []);
  file = answer.value;
  byId("file-name").textContent = file.file;
  byId("file-keys").replaceChildren(...file.keys.map(field));
  byId("file-text").value = file.text;
  byId("file-now").hidden = !file.at_once;
  byId("file-check").textContent = words(file.at_once ? "file_later" : "file_write");
  return tell("", []);
}

const nameOf = (location) => location.map((step) => typeof step === "number" ? `${step + 1}` : step).join(" ");

function field(key) {
  const label = document.createElement("label"), name = document.createElement("span"), small = document.createElement("small");
  const input = document.createElement("input");
  name.textContent = nameOf(key.location);
  input.type = key.kind === "switch" ? "checkbox" : "text";
  if (key.kind === "number") input.inputMode = "decimal";
  if (key.kind === "switch") input.checked = key.value;
  else input.value = key.kind === "list" ? key.value.join(", ") : key.value ?? "";
  input.autocomplete = "off";
  input.spellcheck = false;
  input.setAttribute("autocapitalize", "off");
  input.name = key.location.join(".");
  small.textContent = key.within ? `${key.words} (${key.within})` : key.words;
  small.lang = "en";
  label.className = "venue-key";
  label.append(name, input, small);
  return label;
}

// Only what was changed: what the file leaves out stays out.
function changed() {
  return file.keys.flatMap((key, place) => {
    const value = typed(key, byId("file-keys").children[place].querySelector("input"));
    return JSON.stringify(value) === JSON.stringify(key.value) ? [] : [[key.location, value]];
  });
}

function typed(key, input) {
  if (key.kind === "switch") return input.checked;
  const said = input.value.trim();
  if (key.kind === "list") return said ? said.split(",").map((one) => one.trim()) : [];
  if (key.kind === "number" && said !== "" && Number.isFinite(Number(said))) return Number(said);
  return said === "" && key.value === null ? null : said;
}

async function save(now) {
  tell(words("file_checking"), []);
  const buttons = [byId("file-check"), byId("file-now")];
  for (const button of buttons) button.disabled = true;
  const wanted = { text: byId("file-text").value, values: changed(), now };
  const sure = asked === JSON.stringify(wanted);  // the same once more answers its questions
  asked = "";
  const answer = await ask("/api/box/file", { ...wanted, sure }, CHECKED_WITHIN_MS);
  for (const button of buttons) button.disabled = false;
  if (answer.status !== 200) return tell(answer.words || words("no_page"), []);
  const { problems, asks, words: said } = answer.value;
  if (problems.length) return tell(words("file_refused"), problems);
  if (asks) {
    asked = JSON.stringify(wanted);
    return tell(words("file_sure"), asks.map((one) => ({ words: one })));
  }
  if (!now) await readFile();
  return tell(said, []);
}

function tell(sentence, problems) {
  byId("file-said").textContent = sentence;
  byId("file-problems").replaceChildren(...problems.map((one) => {
    const item = document.createElement("li");
    item.textContent = one.line ? `${words("file_line", one)} ${one.words}` : one.words;
    return item;
  }));
}
