// Box: which show dances and which would instead, release, addresses, clock.
import { breakable, byId, fact } from "./elements.js";
import { twice } from "./hold.js";
import { danceAgain } from "./venue.js";
import { date, translated, words } from "./words.js";

export async function readAbout() {
  byId("box-said").textContent = words("box_reading");
  let answer = null;
  try {
    answer = await fetch("/api/box");
  } catch { /* said below */ }
  byId("box-all").hidden = !answer?.ok;
  byId("box-said").textContent = answer?.ok ? "" : answer ? translated(await answer.text()) : words("no_page");
  if (answer?.ok) render(await answer.json());
}

function render(box) {
  byId("box-shows-part").hidden = box.shows.length === 0;
  byId("box-shows").replaceChildren(...box.shows.map(shown));
  const refused = [...box.refused, ...box.aside];
  byId("box-refused-part").hidden = refused.length === 0;
  byId("box-refused").replaceChildren(...refused.map((sentence) => item(translated(sentence), "")));
  byId("box-release").replaceChildren(
    pair(words("box_version"), box.version), pair(words("box_file"), box.box_file ?? words("box_no_file")));
  byId("box-releases").replaceChildren(...box.releases.map((name) => item(name, name === box.release ? words("box_current") : "")));
  byId("box-rollback").hidden = box.releases.indexOf(box.release) < 1;
  byId("box-network").replaceChildren(
    pair(words("box_host"), box.host),
    ...box.addresses.map(([name, address]) => pair(name, address)));
}

// The box's clock, which a Pi without a network has wrong.
export function showClock(value) {
  byId("box-clock").textContent = words("box_time", { time: date(value.time, "medium") });
}

// Each but the first can be danced again, where the box has kept it; what comes with the box is the last resort.
function shown(show, place) {
  const line = item(translated(show.source), `${words(place ? "box_instead" : "box_dances")} · ${words(show.good ? "box_good" : "box_new")}`);
  if (place === 0 || !show.id) return line;
  const row = document.createElement("div"), button = document.createElement("button");
  row.className = "row";
  button.type = "button";
  button.textContent = words("dance_again");
  twice(button, () => danceAgain(show.id), "sure_now");
  row.append(button);
  line.append(row);
  return line;
}

function item(said, below) {
  const line = document.createElement("li"), small = document.createElement("small");
  line.append(...breakable(said));
  small.textContent = below;
  if (below) line.append(small);
  return line;
}

const pair = (term, meaning) => fact(term, ...breakable(meaning));
