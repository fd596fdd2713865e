// Small helpers: clones of the page's templates, texts and numbers for people.

export const $ = (selector, root = document) => root.querySelector(selector);
export const $$ = (selector, root = document) => [...root.querySelectorAll(selector)];

/** An element; text is always text, never markup. */
export function element(name, { text, ...attributes } = {}, ...children) {
  const node = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) if (value !== undefined) node.setAttribute(key, value);
  node.append(...(text === undefined ? [] : [text]), ...children);
  return node;
}

/** The first element of a clone of a template of the page, or all of it as a fragment. */
export const clone = (id) => document.getElementById(id).content.firstElementChild.cloneNode(true);
export const cloneAll = (id) => document.getElementById(id).content.cloneNode(true);

/** Put texts into the `data-slot`s of a node. */
export function fill(root, texts) {
  for (const [name, text] of Object.entries(texts)) {
    const slot = $(`[data-slot="${name}"]`, root);
    if (slot && slot.textContent !== text) slot.textContent = text;
  }
  return root;
}

export function badge(root, status) {
  const node = $('[data-slot="status"]', root);
  node.className = `badge ${status}`;
  fill(root, { status });
}

export function showProblem(root, error) {
  const box = $(".problem", root);
  const details = (error?.fields?.errors ?? []).map((one) => Object.values(one).join(": "));
  box.textContent = error ? [error.message ?? String(error), ...details].join("\n") : "";
  box.hidden = !error;
}

export const announce = (text) => { $("#announce").textContent = text; };

/** Three digits; no exponent where people can do without. */
export function number(value) {
  if (Array.isArray(value)) return `(${value.map(number).join(", ")})`;
  if (typeof value !== "number") return String(value ?? "");
  if (value === 0 || Number.isInteger(value)) return String(value);
  const size = Math.abs(value);
  return size < 1e-4 || size >= 1e7 ? value.toExponential(2) : String(Number(value.toPrecision(3)));
}

const UNITS = [["B", 1], ["kB", 1e3], ["MB", 1e6], ["GB", 1e9]];
export function bytes(count) {
  const [unit, size] = UNITS.findLast(([, least]) => count >= least) ?? UNITS[0];
  return `${Number((count / size).toPrecision(3))} ${unit}`;
}

export const unit = (name) => (name === "1" ? "" : name.replaceAll("*", "·").replaceAll(/\^([23])/g, (_, n) => ({ 2: "²", 3: "³" })[n]));
export const words = (name) => name.replaceAll("_", " ");
export const moment = (text) => (text ? new Date(text).toLocaleString([], { dateStyle: "medium", timeStyle: "short" }) : "");
export const duration = (from, to) => {
  const seconds = Math.max(0, (Date.parse(to ?? new Date().toISOString()) - Date.parse(from)) / 1000);
  return seconds < 90 ? `${Math.round(seconds)} s` : `${Math.round(seconds / 60)} min`;
};

/** Let the browser save a blob under a name. */
export function save(blob, name) {
  const url = URL.createObjectURL(blob);
  element("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 60_000);
}
