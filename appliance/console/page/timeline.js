// A run of the journal over the time of day: its slowest ticks, what went wrong, and what was commanded.
import { clock, exact, number, words } from "./words.js";

const TICK_MS = 20, TOPS_MS = [25, 50, 100, 200, 500, 1000, 10_000]; // what fills the height
const STEPS_S = [10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 14_400], LABEL_PX = 62;
const LEFT = 34, RIGHT = 8, TOP = 20, LANE = 10, GAP = 3, TEXT = 12, LABELS = 22; // CSS pixels
const WRONG = ["late", "skipped", "failed"];
const INK = {
  slowest: "#7f8a96", late: "#ff7a66", skipped: "#f0b840", failed: "#d36bff", order: "#58c27d",
  mark: "#f3ece0", text: "#b3b7bd", line: "#3d434b",
};

// The meaning of each colour.
export function showLegend(parent) {
  const said = { slowest: "legend_slowest", late: "legend_late", skipped: "legend_skipped", failed: "legend_failed", order: "happened_order" };
  parent.replaceChildren(...Object.entries(said).map(([what, key]) => {
    const one = document.createElement("span"), dot = document.createElement("i");
    dot.style.background = INK[what];
    one.append(dot, words(key));
    return one;
  }));
}

// The second of a run at x of a picture that is so wide, in CSS pixels.
export const secondAt = (run, x, wide) => run.seconds * (x - LEFT) / (wide - LEFT - RIGHT);

// second: where the marked stretch begins; stretch: its seconds.
export function drawTimeline(canvas, run, second, stretch) {
  if (!run || canvas.offsetParent === null) return;
  const ratio = Math.min(devicePixelRatio || 1, 2), wide = canvas.clientWidth, high = canvas.clientHeight;
  [canvas.width, canvas.height] = [Math.round(wide * ratio), Math.round(high * ratio)];
  const ink = canvas.getContext("2d"), floor = high - LABELS - 2 * (LANE + GAP);
  ink.scale(ratio, ratio);
  ink.font = `${TEXT}px system-ui, sans-serif`;
  const across = (at) => LEFT + (wide - LEFT - RIGHT) * at / run.seconds, step = across(run.bin_s) - LEFT;
  const top = TOPS_MS.find((one) => one >= Math.max(...run.slowest_ms)) ?? TOPS_MS.at(-1);
  const up = (ms) => floor - (floor - TOP) * Math.min(1, ms / top);
  ink.fillStyle = "#f3ece02a";
  ink.fillRect(across(second), TOP - 6, Math.max(2, across(Math.min(second + stretch, run.seconds)) - across(second)), high - LABELS - TOP + 6);
  run.slowest_ms.forEach((ms, place) => {
    ink.fillStyle = ms > TICK_MS ? INK.late : INK.slowest;
    ink.fillRect(LEFT + place * step, up(ms), Math.max(1, step - 0.5), floor - up(ms));
  });
  WRONG.forEach((what, lane) => run[what].forEach((count, place) => {
    ink.fillStyle = INK[what];
    if (count) ink.fillRect(LEFT + place * step, floor + GAP + lane * LANE / 3, Math.max(2, step - 0.5), LANE / 3);
  }));
  ink.fillStyle = INK.order;
  for (const [at, kind] of run.events) if (kind === "order") ink.fillRect(across(at), floor + LANE + 2 * GAP, 2, LANE);
  drawAxes(ink, { run, across, up, top, floor, wide, high });
  ink.fillStyle = INK.mark;
  ink.fillRect(across(second) - 1, TOP - 6, 2, high - LABELS - TOP + 6);
}

function drawAxes(ink, { run, across, up, top, floor, wide, high }) {
  ink.strokeStyle = INK.line;
  ink.strokeRect(LEFT, floor, wide - LEFT - RIGHT, 0);
  ink.fillStyle = INK.text;
  ink.textAlign = "right";
  for (const ms of new Set([0, TICK_MS, ...top > 2 * TICK_MS ? [top] : []])) ink.fillText(number(ms), LEFT - 6, up(ms) + 4);
  ink.fillText("ms", LEFT - 6, 12);
  ink.textAlign = "left";
  ink.fillStyle = ink.strokeStyle = INK.skipped;
  ink.setLineDash([5, 4]);
  ink.beginPath();
  ink.moveTo(LEFT, up(TICK_MS));
  ink.lineTo(wide - RIGHT, up(TICK_MS));
  ink.stroke();
  ink.setLineDash([]);
  ink.fillText(words("legend_tick"), LEFT + 4, up(TICK_MS) - 5);
  const apart = STEPS_S.find((one) => across(one) - LEFT >= LABEL_PX) ?? 86_400, said = apart < 60 ? exact : clock;
  ink.fillStyle = INK.text;
  ink.textAlign = "center";
  for (let at = apart - run.begun % apart; at < run.seconds; at += apart) {
    ink.fillRect(across(at), floor, 1, high - LABELS - floor + 3);
    if (across(at) > LEFT + 12 && across(at) < wide - 20) ink.fillText(said(run.begun + at), across(at), high - 6);
  }
}
