// Joints by the names that people use, in the reader's language. The box knows the parts of each skeleton
// (appliance/pose/spoken_joints.py); a joint that it does not understand keeps the skeleton's own name.
import { hasWords, words } from "./words.js";

const parts = new Map();

export function nameJoints({ joints, parts: spoken }) {
  parts.clear();
  joints.forEach((name, joint) => parts.set(name, spoken[joint]));
}

// The source that holds a joint: a sensor by its name, others by a word.
export const sourceName = (source) => hasWords(`source_of_${source}`) ? words(`source_of_${source}`) : source;

// left shoulder, right index finger 2
export function jointName(name) {
  const [, side, part, number] = /^(left |right )?(.*?)( \d+)?$/.exec(parts.get(name) ?? "");
  if (!part) return name;
  const [left, right] = words(`joint_${part.replaceAll(" ", "_")}`).split("|");
  return `${side === "right " ? right : left}${number ?? ""}`;
}
