// The last lines of the box's units, for a device that gave the PIN.
import { ask } from "./device.js";
import { byId } from "./elements.js";
import { clock, translated, words } from "./words.js";

export function initLogs() {
  byId("logs-read").addEventListener("click", readLogs);
}

async function readLogs() {
  byId("logs-said").textContent = words("box_reading");
  const answer = await ask("/api/logs");
  byId("logs-said").textContent = answer.status === 200 ? words(answer.value.length ? "logs_newest" : "logs_none") : translated(answer.message) || words("no_page");
  if (answer.status !== 200) return;
  byId("logs").replaceChildren(...answer.value.reverse().map((line) => {
    const item = document.createElement("li"), small = document.createElement("small");
    const name = words(`unit_${line.unit}`);
    item.textContent = line.message;
    item.classList.toggle("amiss", line.priority <= 4); // a warning, or worse
    small.textContent = `${clock(line.time)} · ${name.startsWith("unit_") ? line.unit : name}`;
    item.append(small);
    return item;
  }));
}
