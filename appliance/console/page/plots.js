// The plots of a measurement: how long readings were on their way, as a histogram and reading by reading.
import { number, words } from "./words.js";

const LONGEST_MS = 45, STEP_MS = 0.5;
export const DARK = { ground: "#0d0f11", ink: "#f3ece0", quiet: "#b3b7bd", bar: "#ff8a5c", line: "#3d434b", fault: "#ff7a66", well: "#58c27d" };
export const PAPER = { ground: "#ffffff", ink: "#111111", quiet: "#555555", bar: "#c4411d", line: "#bbbbbb", fault: "#b3150a", well: "#1b7a3d" };

// at: seconds; ms: their transport; settling: seconds that do not count; limits: {median, p99} in ms, where they are
// known. The plots fill x, y, width, height.
export function drawPlots(context, { x, y, width, height }, { at, ms, settling, seconds, limits }, look, size) {
  const half = height / 2;
  const counted = ms.filter((_, place) => at[place] >= settling);
  const marks = Object.entries(limits ?? {}).filter(([, most]) => most > 0 && most <= LONGEST_MS);
  histogram(context, { x, y, width, height: half - size }, counted, marks, look, size);
  timeline(context, { x, y: y + half, width, height: half - size }, { at, ms, settling, seconds, marks }, look, size);
}

// A limit: a dashed line across the plot, and what it is for.
function mark(context, from, to, said, look, size) {
  context.save();
  context.strokeStyle = context.fillStyle = look.well;
  context.lineWidth = Math.max(1.5, size / 9);
  context.setLineDash([size / 2, size / 3]);
  context.beginPath();
  context.moveTo(...from);
  context.lineTo(...to);
  context.stroke();
  context.textAlign = "left";
  context.font = `600 ${size * 0.85}px system-ui, sans-serif`;
  context.fillText(said, from[0] + 0.3 * size, to[1] + 0.9 * size);
  context.restore();
}

function frame(context, { x, y, width, height }, title, unit, look, size) {
  context.font = `600 ${size}px system-ui, sans-serif`;
  context.fillStyle = look.ink;
  context.textAlign = "left";
  context.fillText(title, x, y + size);
  const taken = context.measureText(title).width;
  context.font = `${size * 0.85}px system-ui, sans-serif`;
  context.fillStyle = look.quiet;
  context.textAlign = "right";
  const isBelow = taken + context.measureText(unit).width + size > width; // on a phone
  context.fillText(unit, x + width, y + size + (isBelow ? 1.5 * size : 0));
  const plot = { x: x + 2.6 * size, y: y + 1.7 * size, width: width - 3.2 * size, height: height - 3.4 * size };
  context.strokeStyle = look.line;
  context.lineWidth = Math.max(1, size / 14);
  context.beginPath();
  context.moveTo(plot.x, plot.y);
  context.lineTo(plot.x, plot.y + plot.height);
  context.lineTo(plot.x + plot.width, plot.y + plot.height);
  context.stroke();
  return plot;
}

function across(context, plot, most, step, look, size, digits = 0) {
  context.textAlign = "center";
  context.fillStyle = look.quiet;
  for (let tick = 0; tick <= most + 1e-9; tick += step) {
    context.fillText(number(tick, digits), plot.x + plot.width * tick / most, plot.y + plot.height + 1.2 * size);
  }
}

function upwards(context, plot, most, step, look, size) {
  context.textAlign = "right";
  context.fillStyle = look.quiet;
  for (let tick = 0; tick <= most + 1e-9; tick += step) {
    context.fillText(number(tick), plot.x - 0.4 * size, plot.y + plot.height * (1 - tick / most) + 0.3 * size);
  }
}

function histogram(context, place, counted, marks, look, size) {
  const plot = frame(context, place, words("prove_histogram"), words("prove_share"), look, size);
  across(context, plot, LONGEST_MS, 5, look, size);
  const bars = new Array(LONGEST_MS / STEP_MS).fill(0);
  for (const one of counted) bars[Math.min(bars.length - 1, Math.floor(one / STEP_MS))] += 1;
  const shares = bars.map((count) => 100 * count / Math.max(1, counted.length));
  const most = Math.max(10, 10 * Math.ceil(Math.max(...shares) / 10));
  upwards(context, plot, most, most / 2, look, size);
  context.fillStyle = look.bar;
  const wide = plot.width / bars.length;
  shares.forEach((share, slot) => {
    const high = plot.height * share / most;
    context.fillRect(plot.x + slot * wide, plot.y + plot.height - high, wide * 0.9, high);
  });
  marks.forEach(([name, limit], line) => {
    const across_px = plot.x + plot.width * limit / LONGEST_MS, top = plot.y + line * 1.1 * size;
    mark(context, [across_px, plot.y + plot.height], [across_px, top], words(`prove_limit_${name}`, { most: number(limit) }), look, size);
  });
}

function timeline(context, place, { at, ms, settling, seconds, marks }, look, size) {
  const plot = frame(context, place, words("prove_timeline"), "ms / s", look, size);
  const longest = Math.max(seconds, at.length ? at[at.length - 1] : 0, 1);
  const step = [1, 2, 5, 10, 20, 30, 60].find((one) => longest / one <= 8) ?? 120;
  across(context, plot, longest, step, look, size);
  upwards(context, plot, LONGEST_MS, 15, look, size);
  const dot = Math.max(2, size / 6);
  at.forEach((second, slot) => {
    context.fillStyle = second < settling ? look.line : look.bar;
    const high = plot.height * Math.min(1, ms[slot] / LONGEST_MS);
    context.fillRect(plot.x + plot.width * second / longest - dot / 2, plot.y + plot.height - high - dot / 2, dot, dot);
  });
  for (const [, limit] of marks) {
    const up = plot.y + plot.height * (1 - limit / LONGEST_MS);
    mark(context, [plot.x, up], [plot.x + plot.width, up], "", look, size);
  }
}
