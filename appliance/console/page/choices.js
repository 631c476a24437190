// Buttons of which one is in force. They stay the same elements: one that is replaced under a finger gets no click.
// An entry may have a picture (its address) and colours.
export function showChoices(parent, part, entries, act) {
  part.hidden = entries.length === 0;
  const made = JSON.stringify(entries.map(({ name, picture, colours }) => [name, picture, colours]));
  if (parent.dataset.made !== made) {
    parent.dataset.made = made;
    parent.replaceChildren(...entries.map((one) => {
      const button = document.createElement("button");
      button.type = "button";
      button.addEventListener("click", () => act(one.name, button.getAttribute("aria-pressed") === "true"));
      if (one.picture) button.append(pictureOf(one), document.createElement("span"));
      return button;
    }));
  }
  entries.forEach((one, place) => {
    const button = parent.children[place], label = one.picture ? button.lastChild : button, said = one.label ?? one.name;
    if (label.textContent !== said) label.textContent = said;
    button.title = one.title ?? "";
    button.setAttribute("aria-pressed", one.now);
  });
}

function pictureOf({ picture, colours = [] }) {
  const whole = document.createElement("span"), image = document.createElement("img");
  whole.className = "tile";
  image.src = picture;
  image.alt = "";
  whole.append(image, ...colours.map((colour) => {
    const dot = document.createElement("i");
    dot.style.background = colour;
    return dot;
  }));
  return whole;
}

// How looks of a style are drawn, as a small picture.
export const pictureOfStyle = (style) => `/looks/${style}.webp`;
