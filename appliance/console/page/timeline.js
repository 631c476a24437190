// A run of the journal over the time of day: its slowest ticks, what went wrong, and what was commanded.
import { clock, exact, number } from "./words.js";

const TICK_MS = 20, TOPS_MS = [25, 50, 100, 200, 500, 1000, 10_000]; // what fills the height
const STEPS_S = [10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 14_400], LABEL_PX = 62;
const LEFT = 52, RIGHT = 8, TOP = 10, LANES = 3, LANE = 7, GAP = 3, TEXT = 12, LABELS = 20; // CSS pixels
const WRONG = ["late", "skipped", "failed"];
export const INK = { // kinds of entries, and what is drawn
  fault: "#ff7a66", order: "#58c27d", said: "#6cb4ee", slowest: "#7f8a96", mark: "#f3ece0", text: "#b3b7bd", line: "#3d434b",
};

// The second of a run at x of a picture that is so wide, in CSS pixels.
export const secondAt = (run, x, wide) => run.seconds * (x - LEFT) / (wide - LEFT - RIGHT);

// second: where the stretch begins that is played; stretch: its seconds; picked: [from, to], all else is dimmed.
export function drawTimeline(canvas, run, second, stretch, picked) {
  if (!run || canvas.offsetParent === null) return;
  const ratio = Math.min(devicePixelRatio || 1, 2), wide = canvas.clientWidth, high = canvas.clientHeight;
  [canvas.width, canvas.height] = [Math.round(wide * ratio), Math.round(high * ratio)];
  const ink = canvas.getContext("2d"), floor = high - LABELS - LANES * LANE - GAP;
  ink.scale(ratio, ratio);
  ink.font = `${TEXT}px system-ui, sans-serif`;
  const across = (at) => LEFT + (wide - LEFT - RIGHT) * at / run.seconds, step = across(run.bin_s) - LEFT;
  const top = TOPS_MS.find((one) => one >= Math.max(...run.slowest_ms)) ?? TOPS_MS.at(-1);
  const up = (ms) => floor - (floor - TOP) * Math.min(1, ms / top);
  run.slowest_ms.forEach((ms, place) => {
    ink.fillStyle = ms > TICK_MS ? INK.fault : INK.slowest;
    ink.fillRect(LEFT + place * step, up(ms), Math.max(1, step - 0.5), floor - up(ms));
    if (!WRONG.some((what) => run[what][place])) return;
    ink.fillStyle = INK.fault;
    ink.fillRect(LEFT + place * step, floor + GAP, Math.max(3, step - 0.5), LANE - 1);
  });
  for (const [at, kind] of run.events) {
    ink.fillStyle = INK[kind] ?? INK.said;
    ink.fillRect(across(at), floor + GAP + LANE * (kind === "order" ? 1 : 2), 2, LANE - 1);
  }
  drawAxes(ink, { run, across, up, top, floor, wide, high });
  ink.fillStyle = "#0d0f11b8";
  const edges = picked?.map((at) => Math.min(Math.max(LEFT, across(at)), wide - RIGHT));
  if (edges) {
    ink.fillRect(LEFT, 0, edges[0] - LEFT, high - LABELS);
    ink.fillRect(edges[1], 0, wide - RIGHT - edges[1], high - LABELS);
  }
  ink.fillStyle = "#f3ece030";
  ink.fillRect(across(second), 4, Math.max(2, across(Math.min(second + stretch, run.seconds)) - across(second)), high - LABELS - 4);
  ink.fillStyle = INK.mark;
  ink.fillRect(across(second) - 1, 4, 2, high - LABELS - 4);
}

function drawAxes(ink, { run, across, up, top, floor, wide, high }) {
  ink.fillStyle = INK.line;
  ink.fillRect(LEFT, floor, wide - LEFT - RIGHT, 1);
  ink.fillStyle = INK.text;
  ink.textAlign = "right";
  for (const ms of top > 2 * TICK_MS ? [top] : [TICK_MS]) ink.fillText(`${number(ms)} ms`, LEFT - 5, up(ms) + 4);
  ink.strokeStyle = INK.text;
  ink.setLineDash([3, 4]);
  ink.beginPath();
  ink.moveTo(LEFT, up(TICK_MS));
  ink.lineTo(wide - RIGHT, up(TICK_MS));
  ink.stroke();
  ink.setLineDash([]);
  const apart = STEPS_S.find((one) => across(one) - LEFT >= LABEL_PX) ?? 86_400, said = apart < 60 ? exact : clock;
  ink.textAlign = "center";
  for (let at = apart - run.begun % apart; at < run.seconds; at += apart) {
    if (across(at) > LEFT + 12 && across(at) < wide - 20) ink.fillText(said(run.begun + at), across(at), high - 5);
  }
}
