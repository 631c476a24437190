// A proof as a document: one sheet of paper, to be printed or sent as a picture.
import { drawPlots, PAPER } from "./plots.js";
import { date, hasWords, number, translated, words } from "./words.js";

const WIDTH = 1240, HEIGHT = 1754, MARGIN = 90; // A4 at 150 dots an inch

export const verdictOf = (proof) => words(`prove_${proof.kind}_${proof.holds ? "holds" : "fails"}`);
export const madeAt = (proof) => date(proof.made);

// The name of a limit in the reader's language.
export function limitWords(limit) {
  const key = `limit_${limit.label.toLowerCase().replace(/[^a-z0-9]+/g, "_")}`;
  const said = words(key);
  return said === key ? limit.label : said;
}

// A finding in the reader's language: [account, cure]. One about a fallback is named like `stage: receiver-gone
// (10.0.0.9:9004)`, and the sentence of the fallback ends with its cure.
export function findingWords(finding) {
  const [, , name, about] = /^(\w+): ([a-z-]+)(?: \((.*)\))?$/.exec(finding.what) ?? [];
  const key = about && hasWords(`named_${name}`) ? `named_${name}` : `fallback_${name}`;
  if (name && hasWords(key)) return [`${about && key.startsWith("fallback_") ? `${about}: ` : ""}${words(key, { about })}`, ""];
  return [`${translated(finding.what)}: ${translated(finding.message)}`, translated(finding.cure)];
}

export const valueOf = (limit) => limit.value === null ? words("prove_nothing_came") : `${number(limit.value, 2)} ${limit.unit}`;
export const mostOf = (limit) => words("prove_at_most", { most: `${number(limit.most, 2)} ${limit.unit}` });

// Limits of the transport, in ms, from those of a proof.
export function limitsOf(limits) {
  const most = (label) => limits.find((one) => one.label === label)?.most;
  return { median: most("transport, median"), p99: most("transport, p99") };
}

export function drawCertificate(canvas, proof) {
  const context = canvas.getContext("2d");
  canvas.width = WIDTH;
  canvas.height = HEIGHT;
  const end = draw(context, proof, HEIGHT);
  if (end > HEIGHT) { // a doctor's long report: a longer sheet
    canvas.height = end;
    draw(context, proof, end);
  }
  canvas.setAttribute("aria-label", `${words(`prove_${proof.kind}`)}: ${verdictOf(proof)} ${madeAt(proof)}`);
}

function draw(context, proof, height) {
  context.fillStyle = PAPER.ground;
  context.fillRect(0, 0, WIDTH, height);
  context.textAlign = "left";
  let y = MARGIN + 40;
  y = text(context, "Bunraku", MARGIN, y, 30, PAPER.quiet, "600");
  y = text(context, words(`prove_${proof.kind}`), MARGIN, y + 22, 52, PAPER.ink, "700");
  y = text(context, verdictOf(proof), MARGIN, y + 14, 34, proof.holds ? PAPER.well : PAPER.fault, "700") + 10;
  for (const [term, meaning] of facts(proof)) {
    text(context, term, MARGIN, y + 6, 22, PAPER.quiet, "400");
    y = text(context, meaning, MARGIN + 250, y + 6, 22, PAPER.ink, "400");
  }
  y = proof.kind === "latency" ? latency(context, proof, y + 30) : doctor(context, proof, y + 30);
  return text(context, words("prove_number", { number: proof.id, host: proof.host }), MARGIN, y + 26, 20, PAPER.quiet, "400") + MARGIN / 2;
}

function facts(proof) {
  const { machine, software } = proof;
  const versions = Object.entries(software).map(([name, version]) => `${name} ${version}`).join(", ");
  const said = [
    [words("prove_date"), madeAt(proof)],
    [words("prove_machine"), [machine.model, machine.processor, words("prove_cores", machine), `${number(machine.memory_mb)} MB`, machine.system].filter(Boolean).join(", ")],
    [words("prove_software"), versions],
    [words("show"), `${proof.show.name} (${proof.show.checksum})`],
    [words("box_file"), proof.box_file ? `${proof.box_file.name} (${proof.box_file.checksum})` : words("box_no_file")],
  ];
  if (proof.kind !== "latency") return said;
  const counts = words("prove_counts", proof.figures);
  return [...said, [words("prove_how"), `${words("prove_conditions", { seconds: proof.seconds })} ${counts}`]];
}

function latency(context, proof, y) {
  drawPlots(context, { x: MARGIN, y, width: WIDTH - 2 * MARGIN, height: 500 },
    { at: proof.at_s, ms: proof.transport_ms, settling: proof.settling_s, seconds: proof.seconds, limits: limitsOf(proof.limits) }, PAPER, 22);
  y += 540;
  context.textAlign = "left";
  const { transport_ms: way, response_ms: response } = proof.figures;
  const figures = Object.entries(way).filter(([, value]) => value !== null).map(([name, value]) => `${name} ${number(value, 2)} ms`).join("   ");
  if (figures) y = text(context, `${words("prove_transport")}: ${figures}`, MARGIN, y, 22, PAPER.ink, "600");
  if (response.p50 !== null) y = text(context, `${words("prove_response")}: ${number(response.p50, 1)} ms`, MARGIN, y + 2, 22, PAPER.ink, "600");
  y += 12;
  for (const limit of proof.limits) {
    text(context, limit.holds ? "✓" : "✗", MARGIN, y + 3, 23, limit.holds ? PAPER.well : PAPER.fault, "700");
    text(context, limitWords(limit), MARGIN + 40, y + 3, 22, PAPER.ink, "400");
    context.textAlign = "right";
    text(context, valueOf(limit), WIDTH - MARGIN - 260, y + 3, 22, limit.holds ? PAPER.ink : PAPER.fault, "600");
    y = text(context, mostOf(limit), WIDTH - MARGIN, y + 3, 22, PAPER.quiet, "400");
    context.textAlign = "left";
  }
  return y;
}

function doctor(context, proof, y) {
  for (const finding of proof.findings) {
    const colour = finding.verdict === "wrong" ? PAPER.fault : finding.verdict === "ok" ? PAPER.well : PAPER.ink;
    text(context, words(`finding_${finding.verdict}`), MARGIN, y + 10, 20, colour, "700");
    const [account, cure] = findingWords(finding);
    y = text(context, account, MARGIN + 230, y + 10, 20, PAPER.ink, "400");
    if (cure) y = text(context, `→ ${cure}`, MARGIN + 230, y, 20, PAPER.quiet, "400");
  }
  return y;
}

// Lines of a text that wraps at the right margin; the place of the next one.
function text(context, sentence, x, y, size, colour, weight) {
  context.font = `${weight} ${size}px system-ui, sans-serif`;
  context.fillStyle = colour;
  const most = context.textAlign === "left" ? WIDTH - MARGIN - x : WIDTH;
  let line = "";
  for (const word of sentence.split(" ")) {
    const longer = line ? `${line} ${word}` : word;
    if (line && context.measureText(longer).width > most) {
      context.fillText(line, x, y);
      y += 1.35 * size;
      line = word;
    } else {
      line = longer;
    }
  }
  context.fillText(line, x, y);
  return y + 1.35 * size;
}
