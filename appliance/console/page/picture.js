// Picture: brightness, grid, test card, and corners that move on the wall as far as a finger moves here.
import { command } from "./device.js";
import { byId, every, first } from "./elements.js";

const CORNERS = [[0, 0], [1, 0], [1, 1], [0, 1]]; // in the projector's order
const STEP_S = 0.12;

export function initPicture() {
  for (const [id, address, on] of /** @type {[string, string, number][]} */ ([
    ["grid-on", "/projector/grid", 1], ["grid-off", "/projector/grid", 0],
    ["info-on", "/projector/info", 1], ["info-off", "/projector/info", 0],
  ])) byId(id).addEventListener("click", () => command(address, on));
  byId("corners-reset").addEventListener("click", () => command("/projector/corners/reset"));
  const brightness = byId("brightness");
  const tell = () => { byId("brightness-said").textContent = `${brightness.value} %`; };
  brightness.addEventListener("input", tell);
  brightness.addEventListener("change", () => command("/projector/brightness", Number(brightness.value) / 100));
  tell();
  CORNERS.forEach(([x, y], place) => byId("corners").append(handle(x, y, place + 1)));
}

export function showPicture(value) {
  const runs = (name) => value.processes.some((one) => one.process === name && !one.late);
  const projects = runs("projector");
  first('[data-page="picture"]').hidden = !projects && !runs("lights") && value.looks.length === 0;
  for (const id of ["brightness", "grid-on", "info-on", "corners-reset"]) byId(id).parentElement.hidden = !projects;
  byId("corners").hidden = !projects;
  for (const element of every('#picture > h2, #picture > .quiet')) element.hidden = !projects;
}

function handle(x, y, number) {
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = number;
  const put = (dx, dy) => {
    button.style.left = `calc(${100 * (0.12 + 0.76 * x + dx)}% - 32px)`;
    button.style.top = `calc(${100 * (0.18 + 0.64 * y + dy)}% - 32px)`;
  };
  put(0, 0);
  // at: where the finger is, sent: how far the wall has followed, both in shares of the picture. What the
  // projector was too busy to do is asked for again, at the end of a drag three times.
  let from = null, sent = [0, 0], at = [0, 0], timer = 0, isSending = false, misses = 0;
  const rest = () => {
    clearInterval(timer);
    sent = at = [0, 0];
  };
  const send = async () => {
    if (isSending) return;
    const [dx, dy] = [at[0] - sent[0], at[1] - sent[1]];
    if (Math.hypot(dx, dy) <= 0.0005) {
      if (!from) rest();
      return;
    }
    isSending = true;
    const done = await command("/projector/nudge", number, dx, dy);
    isSending = false;
    if (done) sent = [sent[0] + dx, sent[1] + dy];
    else if (!from && ++misses === 3) rest();
  };
  button.addEventListener("pointerdown", (event) => {
    button.setPointerCapture(event.pointerId);
    from = [event.clientX, event.clientY];
    [sent, at, misses] = [[sent[0] - at[0], sent[1] - at[1]], [0, 0], 0];
    clearInterval(timer);
    timer = setInterval(send, 1000 * STEP_S);
  });
  button.addEventListener("pointermove", (event) => {
    if (!from) return;
    const pad = byId("corners").getBoundingClientRect();
    at = [(event.clientX - from[0]) / pad.width, (event.clientY - from[1]) / pad.height];
    put(...at);
  });
  const end = () => {
    if (!from) return;
    from = null;
    put(0, 0);
    send();
  };
  button.addEventListener("pointerup", end);
  button.addEventListener("pointercancel", end);
  button.addEventListener("keydown", (event) => {
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const way = ways[event.key];
    if (!way) return;
    event.preventDefault();
    command("/projector/nudge", number, 0.002 * way[0], 0.002 * way[1]);
  });
  return button;
}
