// Actions that can do nothing now: they are grey, and a tap says why.
import { say } from "./device.js";

// reason: why it can do nothing; "" where it acts.
export function offer(control, reason) {
  control.setAttribute("aria-disabled", String(reason !== ""));
  control.title = reason;
}

addEventListener("click", (event) => {
  const idle = event.target instanceof Element && /** @type {HTMLElement} */ (event.target.closest('[aria-disabled="true"]'));
  if (!idle) return;
  event.stopImmediatePropagation();
  event.preventDefault();
  say(idle.title, true);
}, true);
