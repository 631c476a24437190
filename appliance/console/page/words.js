// The table of words: /words/LANGUAGE.json. A missing word is shown in English.
import { every } from "./elements.js";
let english = {}, own = {}, patterns = [];
export let language = "en", locale = "en"; // dates and numbers are written as this device does

export async function loadWords(languages) {
  const wished = [kept(), ...navigator.languages.map((one) => one.split("-")[0]), "en"];
  language = wished.find((one) => languages.includes(one)) ?? "en";
  locale = navigator.languages.find((one) => one.split("-")[0] === language) ?? language;
  english = await table("en");
  own = language === "en" ? english : await table(language);
  patterns = language === "en" ? [] : compiled(await table(`sentences/${language}`));
  document.documentElement.lang = language;
  for (const element of every("[data-words]")) element.textContent = words(element.dataset.words);
  for (const element of every("[data-alt]")) element.setAttribute("alt", words(element.dataset.alt));
  for (const element of every("[data-label]")) element.setAttribute("aria-label", words(element.dataset.label));
}

// A browser that keeps nothing for pages refuses the question itself.
function kept() {
  try {
    return localStorage.getItem("language");
  } catch {
    return null;
  }
}

export function words(key, values = {}) {
  const sentence = own[key] ?? english[key] ?? key;
  return sentence.replace(/\{(\w+)\}/g, (_, name) => values[name] ?? "");
}

export const hasWords = (key) => key in own;

// A sentence of the box in the reader's language. The box speaks English; /words/sentences/LANGUAGE.json has its
// sentences with the parts that change in braces, as in the source. Without a translation it stays English.
export const translated = (said) => quoted(inOwnLanguage(said));

// Commands and names, which the box writes between backquotes.
export const quoted = (said) => said && said.replace(/`([^`]+)`/g, (_, text) => words("quoted", { text }));

function inOwnLanguage(said) {
  if (!said || patterns.length === 0) return said;
  const whole = matched(said);
  if (whole !== null) return whole;
  return said.split(/(?<=[.?!:;]) (?=\S)/).map(piece).join(" ");
}

// A part of an answer, whose sentence may have lost or gained its full stop.
function piece(said) {
  const bare = said.replace(/\.$/, ""), end = said.slice(bare.length);
  return matched(said) ?? (end ? matched(bare)?.concat(end) : matched(`${said}.`)?.replace(/\.$/, "")) ?? said;
}

function matched(said) {
  for (const [pattern, names, sentence] of patterns) {
    const found = pattern.exec(said);
    if (found) return sentence.replace(/\{(\w+)\}/g, (_, name) => {
      const part = found[names.indexOf(name) + 1] ?? "";
      return part === said ? part : inOwnLanguage(part);
    });
  }
  return null;
}

function compiled(sentences) {
  return Object.entries(sentences).map(([said, sentence]) => {
    const names = [...said.matchAll(/\{(\w+)\}/g)].map((one) => one[1]);
    const escaped = said.replace(/[.*+?^$()|[\]\\]/g, "\\$&").replace(/\{\w+\}/g, "([^]+?)");
    return [new RegExp(`^${escaped}$`), names, sentence, escaped.length];
  }).sort((one, other) => other[3] - one[3]); // the one that says most first
}

export const clock = (seconds) =>
  new Date(1000 * seconds).toLocaleTimeString(locale, { hour: "2-digit", minute: "2-digit", hourCycle: "h23" });

export const exact = (seconds) => new Date(1000 * seconds).toLocaleTimeString(locale, { hourCycle: "h23" });

export const day = (seconds) =>
  new Date(1000 * seconds).toLocaleDateString(locale, { weekday: "short", day: "numeric", month: "short" });

// As people read it in their language: 7 January 2026 at 20:15.
/** @type {(seconds: number, time?: "short" | "medium") => string} */
export const date = (seconds, time = "short") =>
  new Date(1000 * seconds).toLocaleString(locale, { dateStyle: "long", timeStyle: time, hourCycle: "h23" });

export const number = (value, digits = 0) =>
  value.toLocaleString(locale, { minimumFractionDigits: digits, maximumFractionDigits: digits });

// How long something took or lasts, everywhere on the page.
export function duration(seconds) {
  if (seconds < 9) return `${number(seconds, 1)} s`;
  if (seconds < 90) return `${number(seconds)} s`;
  return seconds < 5400 ? `${number(seconds / 60)} min` : `${number(seconds / 3600, 1)} h`;
}

// No line begins with a sign that its language sets apart from the word before: French colons, percent.
const unbroken = (_, value) => typeof value === "string" ? value.replace(/ (?=[:;?!%»])/g, "\u00a0") : value;

async function table(name) {
  try {
    return JSON.parse(await (await fetch(`/words/${name}.json`)).text(), unbroken);
  } catch {
    return {};
  }
}
