// Elements of the page, found by id or by selector.

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
