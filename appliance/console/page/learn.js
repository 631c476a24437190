// Learn tonight, dance tomorrow: two touches, a folder of recordings and the start; then how far it is, and the show.
import { request } from "./box.js";
import { showChoices } from "./choices.js";
import { ask, withPin } from "./device.js";
import { byId } from "./elements.js";
import { twice } from "./hold.js";
import { offer } from "./idle.js";
import { sent } from "./update.js";
import { clock, date, day as dayOf, number, translated, words } from "./words.js";

const LOOK_MS = 2000, LISTED_WITHIN_MS = 20_000, ADOPTED_WITHIN_MS = 430_000;
let timer = 0, chosen = "", isRead = false, reads = 0;

export function initLearn() {
  byId("learn-open").addEventListener("click", () => withPin(read));
  byId("learn-begin").addEventListener("click", async () => showAnswer(await ask("/api/learn", { recordings: chosen, begins_with: byId("learn-show").value })));
  byId("learn-files").addEventListener("change", upload);
  byId("learn-end").addEventListener("click", async () => showAnswer(await ask("/api/learn/end", {})));
  twice(byId("learn-dance"), dance, "sure_now");
  byId("learn-rehearsal").addEventListener("click", async () => {
    const answer = await ask("/api/learn/rehearsal", {}, ADOPTED_WITHIN_MS);
    if (answer.status === 200) chosen = answer.value.name;
    showAnswer(answer);
  });
}

// A device that gave the PIN sees the recordings as soon as it opens this page.
export function showLearn() {
  const { shown, known } = document.body.dataset;
  if (shown === "rehearsal" && known === "yes" && !isRead) read();
}

export function leaveLearn() {
  clearTimeout(timer);
  isRead = false;
}

async function read() {
  clearTimeout(timer);
  isRead = true;
  const own = ++reads;
  const answer = await request("/api/learn", undefined, LISTED_WITHIN_MS);
  if (own !== reads) return undefined;  // an older list would undo a choice among the newer one
  if (answer.status !== 200) return say(translated(answer.message) || words("no_page"));
  const { studio, recordings, shows, journal, runs, progress, can_dance: canDance, show } = answer.value;
  byId("learn-part").hidden = false;
  byId("learn-open").hidden = true;
  chosen = recordings.some((one) => one.name === chosen) ? chosen : "";
  const folders = recordings.map((one) => ({
    name: one.name,
    label: words("learn_folder", { name: folderOf(one.name), files: one.files, minutes: number(one.minutes, 1) }),
    now: one.name === chosen,
  }));
  showChoices(byId("learn-folders"), byId("learn-folders"), runs ? [] : folders, (name) => {
    chosen = name;
    read();
  });
  const before = byId("learn-show").value;
  const offered = shows.map((one) => new Option(labelOf(one), one.id, false, one.id === before));
  byId("learn-show").replaceChildren(new Option(words("learn_new"), ""), ...offered);
  byId("learn-from").hidden = byId("learn-files").closest(".row").hidden = runs;
  byId("learn-begin").hidden = runs || !recordings.length;
  offer(byId("learn-begin"), translated(studio) || (chosen ? "" : words("learn_choose")));
  byId("learn-end").hidden = !runs;
  byId("learn-rehearsal").hidden = runs || !journal;
  byId("learn-dance").hidden = progress.state !== "learned" || !canDance;
  say(studio ? translated(studio) : stateOf(progress, runs, recordings.length, canDance ? "" : show));
  figures(progress.figures ?? []);
  if (runs) timer = setTimeout(read, LOOK_MS);
  return undefined;
}

// The folders that the box makes have their date in the name.
function folderOf(name) {
  const [, kind, year, month, day, hour = 0, minute = 0] = /^box\/(rehearsal|uploaded)-(\d{4})-(\d\d)-(\d\d)(?:-(\d\d)(\d\d)\d\d)?$/.exec(name) ?? [];
  if (!kind) return name;
  const time = new Date(Number(year), Number(month) - 1, Number(day), Number(hour), Number(minute)).getTime() / 1000;
  return words(`learn_folder_${kind}`, { time: kind === "rehearsal" ? `${dayOf(time)}, ${clock(time)}` : dayOf(time) });
}

// A show by its name, and when it came: two of them may have one name.
function labelOf({ name, since, danced }) {
  const time = since ? date(since) : "";
  return words(danced ? "learn_show_danced" : since ? "learn_show" : "learn_show_bundled", { name, time });
}

function stateOf(progress, runs, folders, show) {
  if (!runs && !progress.state) return words(folders ? "learn_choose" : "learn_nothing");
  const values = { percent: Math.floor(100 * (progress.share ?? 0)), message: translated(progress.message ?? ""), show };
  if (progress.state === "learned" && show) return words("learn_learned_here", values);
  return words(`learn_${progress.state}`, values);
}

function figures(rows) {
  byId("learn-figures").replaceChildren(...rows.map((one) => {
    const item = document.createElement("li"), small = document.createElement("small");
    item.textContent = `${one.holds ? "✓" : "✗"} ${one.name}: ${one.value}`;
    item.dataset.kind = one.holds ? "" : "wrong";
    small.textContent = words("learn_beside", one);
    item.append(small);
    return item;
  }));
}

async function dance() {
  say(words("file_checking"));
  const answer = await ask("/api/learn/dance", {}, ADOPTED_WITHIN_MS);
  const problems = answer.value?.problems?.map((one) => translated(one.message)).join(" ");
  say(problems || translated(answer.status === 200 ? answer.value.message : answer.message) || words("no_page"));
}

async function upload() {
  let answer;
  for (const file of byId("learn-files").files) {
    answer = await sent(file, "/api/learn/recording", say);
    if (answer.status !== 200) break;
    chosen = JSON.parse(answer.message).name;
  }
  byId("learn-files").value = "";
  await read();
  if (answer?.status !== 200) say(translated(answer?.message ?? "") || words("no_page"));
}

function showAnswer(answer) {
  if (answer.status === 200) read();
  else say(translated(answer.message) || words("no_page"));
}

function say(sentence) { byId("learn-said").textContent = sentence; }
