// Small helpers: elements of the page, and durations in words.

export const place = id => document.getElementById(id);

export function set(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export function make(tag, name, ...children) {
  const element = document.createElement(tag);
  if (name) element.className = name;
  element.append(...children);
  return element;
}

export function duration(seconds) {
  if (seconds === null || !(seconds >= 0)) return "–";
  if (seconds < 1) return `${Math.round(1000 * seconds)} ms`;
  return `${seconds.toFixed(seconds < 100 ? 1 : 0)} s`;
}
