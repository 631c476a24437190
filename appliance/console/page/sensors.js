// One card for each sensor. A card stays the same element, so that a press on it is never lost.
import { command } from "./device.js";
import { changeButtons } from "./sensor_changes.js";
import { hasWords, number, translated } from "./words.js";

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
    fill(cards.get(sensor.name), sensor, words);
  }
  parent.title = names.length ? "" : words("no_sensors");
}

function made(name, words) {
  const root = document.createElement("article"), title = document.createElement("h3"), state = document.createElement("p");
  const facts = document.createElement("dl"), complaint = document.createElement("p"), row = document.createElement("div");
  title.textContent = name;
  complaint.className = "complaint";
  row.className = "row";
  for (const [key, address] of [["find", "/sensors/strobe"], ["neutral", "/sensors/neutral"], ["heading", "/sensors/heading"]]) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = words(key);
    button.setAttribute("aria-label", `${words(key)}: ${name}`);
    button.addEventListener("click", () => command(address, name));
    row.append(button);
  }
  const changes = document.createElement("div");
  changes.className = "row changes";
  changes.append(...changeButtons(name));
  const last = document.createElement("p");
  last.className = "quiet last";
  last.textContent = words("last");
  root.append(title, state, complaint, last, facts, row, changes);
  return { root, state, facts, complaint };
}

function fill(card, sensor, words) {
  card.root.dataset.state = sensor.state;
  card.root.dataset.worn = String(sensor.is_worn);
  card.facts.classList.toggle("old", !sensor.heard);
  const ago = !sensor.heard && sensor.age_s >= 0 ? ` ${words("heard_before", { time: duration(sensor.age_s) })}` : "";
  card.state.textContent = words(`sensor_${sensor.state}`) + ago;
  card.complaint.textContent = translated(sensor.complaint);
  const grades = ["system", "gyro", "accel", "mag"].map((_, place) => (sensor.calibration >> (6 - 2 * place)) & 3);
  const left = sensor.heard && sensor.battery_left_s >= 0 ? words("battery_left", { time: duration(sensor.battery_left_s) }) : "";
  const battery = sensor.battery === null ? words("unknown_value") : `${sensor.battery} %${left}`;
  const facts = [
    ["rate", sensor.heard ? `${number(sensor.rate_hz, 1)} Hz` : "–"],
    ["loss", sensor.heard ? `${number(100 * sensor.loss, 1)} %` : "–"],
    ["round_trip", sensor.heard && sensor.round_trip_s >= 0 ? `${number(1000 * sensor.round_trip_s, 1)} ms` : "–"],
    ["battery", battery],
    ["signal", sensor.flags >> 4 ? `${4 * (sensor.flags >> 4) - 90} dBm` : words("unknown_value")], // docs/wire.md
    ["calibration", words("of_three", { gyro: grades[1], accel: grades[2] })],
    ["neutral_pose", hasWords(`neutral_${sensor.neutral}`) ? words(`neutral_${sensor.neutral}`) : sensor.neutral || words("not_worn")],
    ["heading_corrected", sensor.is_worn ? `${number(sensor.corrected, 0)}°` : "–"],
    ["way", sensor.way || "–"],
    ["firmware", sensor.firmware || "–"],
  ];
  card.facts.replaceChildren(...facts.map(([key, said]) => {
    const pair = document.createElement("div"), term = document.createElement("dt"), meaning = document.createElement("dd");
    term.textContent = words(key);
    meaning.textContent = said;
    pair.append(term, meaning);
    return pair;
  }));
}

function duration(seconds) {
  if (seconds < 90) return `${Math.round(seconds)} s`;
  return seconds < 5400 ? `${Math.round(seconds / 60)} min` : `${number(seconds / 3600, 1)} h`;
}
