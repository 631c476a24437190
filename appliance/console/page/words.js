// The table of words: /words/LANGUAGE.json; a word that a language lacks is English.
import { every } from "./elements.js";
let english = {}, own = {};
export let language = "en", locale = "en"; // dates and numbers are written as this device does

export async function loadWords(languages) {
  const wished = [localStorage.getItem("language"), ...navigator.languages.map((one) => one.split("-")[0]), "en"];
  language = wished.find((one) => languages.includes(one)) ?? "en";
  locale = navigator.languages.find((one) => one.split("-")[0] === language) ?? language;
  english = await table("en");
  own = language === "en" ? english : await table(language);
  document.documentElement.lang = language;
  for (const element of every("[data-words]")) element.textContent = words(element.dataset.words);
  for (const element of every("[data-label]")) element.setAttribute("aria-label", words(element.dataset.label));
}

export function words(key, values = {}) {
  const sentence = own[key] ?? english[key] ?? key;
  return sentence.replace(/\{(\w+)\}/g, (_, name) => values[name] ?? "");
}

export const hasWords = (key) => key in own;

export const clock = (seconds) =>
  new Date(1000 * seconds).toLocaleTimeString(locale, { hour: "2-digit", minute: "2-digit", hourCycle: "h23" });

export const number = (value, digits = 0) =>
  value.toLocaleString(locale, { minimumFractionDigits: digits, maximumFractionDigits: digits });

async function table(name) {
  try {
    return await (await fetch(`/words/${name}.json`)).json();
  } catch {
    return {};
  }
}
