// Prove it: a measurement begins here, grows while it is looked at, and stays as a document.
import { request } from "./box.js";
import { drawCertificate, findingWords, limitsOf, limitWords, madeAt, mostOf, valueOf, verdictOf } from "./certificate.js";
import { ask, command, say } from "./device.js";
import { byId } from "./elements.js";
import { twice } from "./hold.js";
import { DARK, drawPlots } from "./plots.js";
import { translated, words } from "./words.js";

const LOOK_MS = 500;
const FADED_MS = 20_000; // for a show that stops
const MARK = 0.6; // where a limit is on its scale
let goes = false, isShown = false, timer = 0, next = 0, measured = null, proof = null;

export function initProve() {
  twice(byId("prove-begin"), measure, "sure_stop", () => goes);
  byId("prove-seconds").addEventListener("change", sayBegin);
  byId("prove-doctor").addEventListener("click", () => begin("doctor"));
  byId("prove-end").addEventListener("click", () => ask("/api/prove/end", {}));
  byId("prove-print").addEventListener("click", () => print());
  byId("prove-png").addEventListener("click", savePicture);
}

export async function showProve() {
  isShown = true;
  const answer = await request("/api/prove");
  if (answer.status !== 200) return showSentence(translated(answer.message) || words("no_page"));
  list(answer.value.proofs);
  goes = answer.value.show_goes;
  sayBegin();
  running(answer.value.runs);
  showSentence(answer.value.runs === null && answer.value.show_goes ? words("prove_show_goes") : "");
  if (answer.value.runs !== null) follow(answer.value.runs);
  return undefined;
}

// For how long is in the words of the button.
function sayBegin() {
  const time = byId("prove-seconds").selectedOptions[0].textContent.split(/[:,]/)[0].trim();
  byId("prove-begin").textContent = words(goes ? "prove_stop_begin" : "prove_begin", { time });
}

export function leaveProve() {
  isShown = false;
  clearTimeout(timer);
}

// The measurement begins when the show has faded out.
async function measure() {
  if (goes && !await command("/stop")) return;
  for (let waited = 0; goes && waited < FADED_MS; waited += LOOK_MS) {
    await new Promise((done) => setTimeout(done, LOOK_MS));
    goes = (await request("/api/prove")).value?.show_goes ?? true;
  }
  sayBegin();
  await begin("latency");
}

async function begin(kind) {
  const seconds = Number(byId("prove-seconds").value);
  const answer = await ask("/api/prove", kind === "latency" ? { kind, seconds } : { kind });
  if (answer.status !== 200) {
    showSentence(translated(answer.message) || words("no_page"));
    return;
  }
  byId("prove-document").hidden = true;
  running({ kind });
  follow({ kind, seconds });
}

function follow(wanted) {
  clearTimeout(timer);
  next = 0;
  measured = { at: [], ms: [], settling: 0, seconds: wanted.seconds };
  byId("prove-live").hidden = wanted.kind !== "latency";
  byId("prove-live").scrollIntoView({ block: "center" });
  showSentence(words(`prove_runs_${wanted.kind}`));
  look();
}

async function look() {
  if (!isShown) return;
  let isOver = false;
  try {
    const answer = await fetch(`/api/prove/progress?from=${next}`, { signal: AbortSignal.timeout(6000) });
    const lines = (await answer.text()).split("\n").filter(Boolean);
    next = Number(answer.headers.get("X-Next"));
    for (const written of lines) take(JSON.parse(written));
    isOver = answer.headers.get("X-Runs") === "0" && lines.length === 0;
  } catch { /* the page says by itself that the box is silent; it is asked again */ }
  if (measured.at.length) drawLive();
  if (isOver) await over();
  else timer = setTimeout(look, LOOK_MS);
}

function take(progress) {
  if (progress.phase) {
    if (progress.limits) measured.limits = limitsOf(progress.limits);
    measured.inPhase = progress.phase === "locked";
    if (measured.inPhase) Object.assign(measured, { settling: progress.settling_s, seconds: progress.seconds });
    showSentence(words(`prove_phase_${progress.phase}`, progress));
  }
  if (progress.at_s && measured.inPhase) {
    measured.at.push(...progress.at_s);
    measured.ms.push(...progress.transport_ms);
  }
  if (progress.saved) measured.saved = progress.saved;
  if (progress.trouble) measured.trouble = progress.trouble;
}

function drawLive() {
  const canvas = byId("prove-plots"), scale = devicePixelRatio || 1;
  canvas.width = canvas.clientWidth * scale;
  canvas.height = canvas.clientHeight * scale;
  const context = canvas.getContext("2d");
  context.fillStyle = DARK.ground;
  context.fillRect(0, 0, canvas.width, canvas.height);
  const room = 12 * scale;
  drawPlots(context, { x: room, y: room, width: canvas.width - 2 * room, height: canvas.height - room }, measured, DARK, 13 * scale);
}

async function over() {
  const { saved, trouble } = measured;
  running(null);
  await showProve();
  if (trouble || !saved) showSentence(translated(trouble) || words("prove_broken"));
  else await open(saved);
}

function running(wanted) {
  byId("prove-live").hidden = wanted?.kind !== "latency";
  for (const id of ["prove-begin", "prove-doctor", "prove-seconds"]) byId(id).disabled = wanted !== null;
  byId("prove-end").hidden = wanted === null;
}

function list(proofs) {
  byId("proofs-part").hidden = proofs.length === 0;
  byId("proofs").replaceChildren(...proofs.map((one) => {
    const item = document.createElement("li"), button = document.createElement("button"), small = document.createElement("small");
    button.type = "button";
    button.textContent = `${words(`prove_${one.kind}`)}, ${madeAt(one)}`;
    button.addEventListener("click", () => open(one.id));
    small.textContent = verdictOf(one);
    small.className = one.holds ? "well" : "fault";
    item.append(button, small);
    return item;
  }));
}

async function open(id) {
  const answer = await request(`/api/prove/${id}`);
  if (answer.status !== 200) return say(translated(answer.message) || words("no_page"), true);
  proof = answer.value;
  byId("prove-document").hidden = false;
  byId("prove-verdict").textContent = verdictOf(proof);
  byId("prove-verdict").className = proof.holds ? "well" : "fault";
  byId("prove-next").textContent = words(proof.holds ? "prove_next_well" : `prove_next_${proof.kind}`);
  byId("prove-lines").replaceChildren(...(proof.kind === "latency" ? wrongFirst(proof.limits).map(limitItem) : proof.findings.map(findingItem)));
  drawCertificate(byId("prove-sheet"), proof);
  byId("prove-json").href = `/api/prove/${id}`;
  byId("prove-json").download = `bunraku-${proof.kind}-${id}.json`;
  byId("prove-verdict").scrollIntoView({ block: "center" });
  return undefined;
}

const wrongFirst = (limits) => [...limits].sort((one, other) => Number(one.holds) - Number(other.holds));

// A value on a scale with its limit as a mark: what is good is left of it.
function limitItem(limit) {
  const item = line(`${limit.holds ? "✓" : "✗"} ${limitWords(limit)}`, "", limit.holds ? "" : "wrong");
  const value = document.createElement("b"), scale = document.createElement("i"), small = document.createElement("small");
  value.textContent = valueOf(limit);
  small.textContent = mostOf(limit);
  scale.className = "scale";
  scale.style.setProperty("--value", `${100 * Math.min(1, (limit.value ?? 0) / limit.most * MARK)}%`);
  scale.style.setProperty("--mark", `${100 * MARK}%`);
  item.append(value, scale, small);
  return item;
}

function findingItem(finding) {
  const [account, cure] = findingWords(finding);
  return line(`${words(`finding_${finding.verdict}`)} · ${account}`, cure, finding.verdict);
}

function line(said, below, kind) {
  const item = document.createElement("li"), small = document.createElement("small");
  item.textContent = said;
  item.dataset.kind = kind;
  small.textContent = below;
  if (below) item.append(small);
  return item;
}

function savePicture() {
  byId("prove-sheet").toBlob((blob) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = `bunraku-${proof.kind}-${proof.id}.png`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  }, "image/png");
}

function showSentence(sentence) {
  byId("prove-said").textContent = sentence;
}
