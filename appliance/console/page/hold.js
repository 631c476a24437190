// Two guards for acts that lose something: a button that is held, and one that asks once more in its own place.
import { words } from "./words.js";

const HOLD_MS = 900, SURE_MS = 6000;

// Acts once the button was held, by a finger, the mouse or a key. A tap shows how.
export function held(button, act, explain) {
  let timer = 0, isDone = false;
  const begin = () => {
    if (timer || button.disabled) return;
    isDone = false;
    button.classList.add("holding");
    timer = setTimeout(() => {
      isDone = true;
      end();
      act();
    }, HOLD_MS);
  };
  const end = () => {
    clearTimeout(timer);
    timer = 0;
    button.classList.remove("holding");
  };
  button.classList.add("hold");
  button.addEventListener("pointerdown", begin);
  for (const kind of ["pointerup", "pointerleave", "pointercancel", "blur", "keyup"]) button.addEventListener(kind, end);
  button.addEventListener("keydown", (event) => {
    if (event.key === "Enter" || event.key === " ") begin();
  });
  button.addEventListener("contextmenu", (event) => event.preventDefault());
  button.addEventListener("click", () => { if (!isDone) explain(words("hold_it")); });
}

// isNeeded: false where nothing is lost now; then it acts at once.
export function twice(button, act, key, isNeeded = () => true) {
  let timer = 0, own = "";
  const calm = () => {
    clearTimeout(timer);
    timer = 0;
    button.textContent = own;
  };
  button.addEventListener("click", () => {
    if (timer || !isNeeded()) {
      if (timer) calm();
      act();
      return;
    }
    own = button.textContent;
    button.textContent = words(key);
    timer = setTimeout(calm, SURE_MS);
  });
}
