// Phones in place of sensors, for the technician: a QR code lets one phone be one sensor.
import { request } from "./box.js";
import { ask, say } from "./device.js";
import { byId } from "./elements.js";
import { translated, words } from "./words.js";

const NS = "http://www.w3.org/2000/svg", MARGIN = 4;

export async function initPhones() {
  const sensors = (await request("/api/phones")).value ?? [];
  byId("phones-part").hidden = byId("be-sensor").hidden = sensors.length === 0;
  byId("phones").replaceChildren(...sensors.map(({ name }) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = words("phone_code_show", { name });
    button.addEventListener("click", () => showCode(name));
    return button;
  }));
}

async function showCode(name) {
  const answer = await ask("/api/phones/code", { name });
  if (answer.status !== 200) return say(translated(answer.message) || words("no_page"), true);
  const { address, seconds, squares } = answer.value;
  byId("phone-code").hidden = false;
  byId("phone-code-said").textContent = words("phone_code_said", { name, minutes: seconds / 60 });
  byId("phone-address").textContent = byId("phone-address").href = address;
  const size = squares.length + 2 * MARGIN, drawing = byId("phone-qr"), dark = document.createElementNS(NS, "path");
  drawing.setAttribute("viewBox", `0 0 ${size} ${size}`);
  const marks = squares.flatMap((row, y) => [...row].map((one, x) => (one === "1" ? `M${x + MARGIN} ${y + MARGIN}h1v1h-1z` : "")));
  dark.setAttribute("d", marks.join(""));
  drawing.replaceChildren(dark);
  drawing.scrollIntoView({ block: "center" });
  return undefined;
}
