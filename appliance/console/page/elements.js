// Elements of the page, found by id or by selector, and small ones that several parts make.

// Each id has one kind of element (an input, a canvas); the browser tests look at them all.
/** @type {(id: string) => any} */
export const byId = (id) => document.getElementById(id);

/** @type {(selector: string) => HTMLElement} */
export const first = (selector) => document.querySelector(selector);

/** @type {(selector: string) => NodeListOf<HTMLElement>} */
export const every = (selector) => document.querySelectorAll(selector);

// A path in pieces: a line breaks after a slash, not within a name.
/** @param {string} text */
export const breakable = (text) => text.split(/(?<=\/)(?=[^/])/).flatMap((part) => [part, document.createElement("wbr")]);

// An entry of a list of facts (dl).
/** @param {string} term @param {(string | Node)[]} meaning */
export function fact(term, ...meaning) {
  const both = document.createElement("div"), dt = document.createElement("dt"), dd = document.createElement("dd");
  dt.textContent = term;
  dd.append(...meaning);
  both.append(dt, dd);
  return both;
}
