// Buttons of which one is in force. They stay the same elements: one that is replaced under a finger gets no click.
export function showChoices(parent, part, entries, act) {
  part.hidden = entries.length === 0;
  const names = JSON.stringify(entries.map((one) => one.name));
  if (parent.dataset.names !== names) {
    parent.dataset.names = names;
    parent.replaceChildren(...entries.map((one) => {
      const button = document.createElement("button");
      button.type = "button";
      button.addEventListener("click", () => act(one.name, button.getAttribute("aria-pressed") === "true"));
      return button;
    }));
  }
  entries.forEach((one, place) => {
    const button = parent.children[place], said = one.label ?? one.name;
    if (button.textContent !== said) button.textContent = said;
    button.setAttribute("aria-pressed", one.now);
  });
}
