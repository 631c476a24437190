// One row for each sensor. It stays the same element, so that a press on it is never lost.
import { command } from "./device.js";
import { offer } from "./idle.js";
import { byId, fact } from "./elements.js";
import { jointName } from "./joints.js";
import { changeButton } from "./sensor_changes.js";
import { duration, hasWords, number, translated } from "./words.js";

const FRESH_S = 0.1;
const cards = new Map();

export function showSensors(parent, value, words) {
  const names = value.sensors.map((one) => one.name);
  for (const [name, card] of cards) {
    if (!names.includes(name)) {
      card.root.remove();
      cards.delete(name);
    }
  }
  for (const sensor of value.sensors) {
    if (!cards.has(sensor.name)) {
      cards.set(sensor.name, made(sensor.name, words));
      parent.append(cards.get(sensor.name).root);
    }
    const joints = value.hands.filter((one) => one.source === sensor.name).map((one) => one.joint);
    fill(cards.get(sensor.name), sensor, joints, words);
  }
  const areHeard = value.sensors.some((one) => one.is_worn && one.heard);
  for (const id of ["neutral-all", "heading-all"]) offer(byId(id), areHeard ? "" : words("sensors_silent"));
  setText(byId("sensors-none"), names.length ? "" : words("no_sensors"));
}

// A row: name, joint, state, and what goes bad in the night; its buttons. A press on the row opens the rest.
function made(name, words) {
  const root = document.createElement("article"), more = document.createElement("details"), head = document.createElement("summary");
  const [title, joint, state, complaint, last] = ["h3", "p", "p", "p", "p"].map((tag) => document.createElement(tag));
  const [brief, facts, row, rare] = ["dl", "dl", "div", "div"].map((tag) => document.createElement(tag));
  title.textContent = name;
  joint.className = "joint";
  complaint.className = "complaint";
  row.className = "row";
  row.dataset.locks = "";
  rare.className = "row changes";
  for (const [key, address] of [["find", "/sensors/strobe"], ["neutral", "/sensors/neutral"], ["heading", "/sensors/heading"]]) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = words(key);
    button.setAttribute("aria-label", `${words(key)}: ${name}`);
    button.addEventListener("click", () => command(address, name));
    row.append(button);
  }
  row.append(changeButton("replace", name));
  rare.append(changeButton("rename", name), changeButton("revoke", name));
  last.className = "quiet last";
  last.textContent = words("last");
  head.append(title, joint, state, brief);
  more.append(head, last, facts, rare);
  root.append(more, complaint, row);
  return { root, joint, state, brief, facts, complaint, acts: [...row.querySelectorAll("button:not(.changes)")] };
}

function fill(card, sensor, joints, words) {
  card.root.dataset.state = sensor.state;
  card.root.dataset.worn = String(sensor.is_worn);
  card.facts.classList.toggle("old", !sensor.heard);
  const ago = !sensor.heard && sensor.age_s >= 0 ? ` ${words("heard_before", { time: duration(sensor.age_s) })}` : "";
  card.joint.textContent = joints.map(jointName).join(", ") || words("not_worn");
  card.joint.title = joints.join(", ");
  card.state.textContent = words(`sensor_${sensor.state}`) + ago;
  card.complaint.textContent = translated(sensor.complaint);
  const grades = ["system", "gyro", "accel", "mag"].map((_, place) => (sensor.calibration >> (6 - 2 * place)) & 3);
  const left = sensor.heard && sensor.battery_left_s >= 0 ? words("battery_left", { time: duration(sensor.battery_left_s) }) : "";
  const silent = sensor.heard ? "" : words("sensor_silent", { name: sensor.name });
  for (const button of card.acts) offer(button, silent);
  fillList(card.brief, [
    ["battery", sensor.battery !== null && `${sensor.battery} %${left}`],
    ["reading_age", sensor.age_s >= 0 && (sensor.age_s < FRESH_S ? `< ${number(FRESH_S, 1)} s` : duration(sensor.age_s))],
    ["signal", sensor.flags >> 4 && `${4 * (sensor.flags >> 4) - 90} dBm`], // docs/wire.md
  ], words);
  fillList(card.facts, [
    ["rate", sensor.heard && `${number(sensor.rate_hz, 1)} Hz`],
    ["loss", sensor.heard && `${number(100 * sensor.loss, 1)} %`],
    ["round_trip", sensor.heard && sensor.round_trip_s >= 0 && `${number(1000 * sensor.round_trip_s, 1)} ms`],
    ["calibration", (sensor.heard || sensor.calibration > 0) && words("of_three", { gyro: grades[1], accel: grades[2] })],
    ["neutral_pose", hasWords(`neutral_${sensor.neutral}`) ? words(`neutral_${sensor.neutral}`) : sensor.neutral || words("not_worn")],
    ["heading_corrected", sensor.is_worn && `${number(sensor.corrected, 0)}°`],
    ["way", sensor.way],
    ["firmware", sensor.firmware],
  ], words);
}

// Facts that are not known are left out.
const fillList = (list, facts, words) => list.replaceChildren(...facts.filter(([, said]) => said).map(([key, said]) => fact(words(key), said)));

const setText = (element, text) => { if (element.textContent !== text) element.textContent = text; };
