// A labelled slider that says its value as it moves, and acts once it rests.
export function slider({ id, label, least, most, step, onInput, act }) {
  const made = document.createElement("label"), what = document.createElement("span"), said = document.createElement("b");
  const input = document.createElement("input");
  made.className = "slider";
  what.textContent = label;
  said.id = `${id}-said`;
  Object.assign(input, { id, type: "range", min: least, max: most, step });
  input.addEventListener("input", onInput);
  input.addEventListener("change", () => {
    act(Number(input.value));
    input.blur();
  });
  made.append(what, said, input);
  return made;
}
