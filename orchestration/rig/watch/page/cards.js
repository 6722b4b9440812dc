// A card a signal: its value, its limits, its age and its last minute.

import { draw, notation, shortened, written } from "./chart.js";
import { duration, make, place, set } from "./elements.js";

const NEAR = 0.05; // of the span between the limits
// of that span, or of the command without one: a device reads back within 1 % of its range, and rounds
const DIFFERENT = 0.02;
const OLD = 0.5; // s, or three samples of a slow rig
const BADGES = { near: "near its limit", beyond: "beyond its limit" };

let signals = [];

// Of what a rig says by name; its names may be those of anything.
const named = (record, name) => (Object.hasOwn(record, name) ? record[name] : null);

export function build(rig) {
  signals = [];
  for (const role of ["inputs", "outputs"]) {
    const cards = Object.entries(rig[role]).map(([name, unit]) => card(role, name, unit, named(rig.limits, name)));
    signals.push(...cards);
    const bodies = cards.map(each => each.body);
    place(role).replaceChildren(...(bodies.length ? bodies : [make("p", "none", "none")]));
  }
}

function card(role, name, unit, bounds) {
  const limit = { min: bounds?.min ?? null, max: bounds?.max ?? null };
  const part = {
    value: make("span", "number", "–"),
    unit: make("span", "unit"),
    badge: make("span", "badge"),
    readBack: make("p", "read-back"),
    bar: make("i"),
    mark: make("b"),
    low: make("span"),
    high: make("span"),
    canvas: make("canvas"),
    age: make("p", "age"),
  };
  part.gauge = make("div", "gauge", part.bar, part.mark);
  part.canvas.setAttribute("role", "img");
  part.canvas.setAttribute("aria-label", `${name} over the last minute`);
  const value = make("div", "value", part.value, part.unit);
  const top = make("div", "top", make("h3", "", name), part.badge, value);
  const limits = make("div", "limits", part.low, part.high);
  const body = make("article", "card", top, part.readBack, part.gauge, limits, part.canvas, part.age);
  body.dataset.signal = name;
  const size = Math.max(Math.abs(limit.min ?? 0), Math.abs(limit.max ?? 0));
  return { role, name, unit, limit, size, part, body };
}

// `now` is the time of the right edge, and `since` how long ago the last sample was sent by the rig, s, at most; null if
// nobody knows.
export function show(samples, now, since, period) {
  const old = Math.max(OLD, 3 * period);
  const colours = { inputs: coloursOf("command"), outputs: coloursOf("measured") };
  for (const signal of signals) {
    const { role, name, unit, limit, size, part } = signal;
    const points = samples.map(sample => [sample.at, named(sample[role], name)]);
    const largest = points.reduce((most, [, value]) => Math.max(most, Math.abs(value ?? 0)), 0);
    const how = notation(size, largest, unit);
    showValue(signal, points.at(-1)?.[1] ?? null, how);
    const last = samples.at(-1);
    if (role === "inputs") showCommand(signal, last, since, old, how);
    else showMeasured(signal, last, since, old);
    if (document.hidden) continue; // nobody sees a chart
    draw(part.canvas, points, { now, limit, how, held: role === "inputs", gap: old, colours: colours[role] });
  }
}

function coloursOf(signal) {
  const style = getComputedStyle(document.documentElement);
  const colour = name => style.getPropertyValue(`--${name}`).trim();
  return { signal: colour(signal), muted: colour("muted"), grid: colour("grid"), forbidden: colour("forbidden") };
}

function showValue({ limit, part, body }, value, how) {
  set(part.value, value === null ? "–" : written(value, how));
  set(part.unit, value === null ? "" : how.unit);
  set(part.low, limit.min === null ? "" : `min ${shortened(limit.min, how)} ${how.unit}`);
  set(part.high, limit.max === null ? "" : `max ${shortened(limit.max, how)} ${how.unit}`);
  const verdict = judge(value, limit);
  body.className = `card ${verdict}`.trim();
  set(part.badge, BADGES[verdict] ?? "");
  showGauge(part, value, limit);
}

function judge(value, { min, max }) {
  if (value === null) return "";
  if ((min !== null && value < min) || (max !== null && value > max)) return "beyond";
  const span = spanOf({ min, max });
  const isClose = bound => bound !== null && bound !== 0 && Math.abs(value - bound) < NEAR * span; // 0 is at rest
  return isClose(min) || isClose(max) ? "near" : "";
}

function spanOf({ min, max }) {
  return min !== null && max !== null ? max - min : Math.abs(max ?? min ?? 0);
}

function showGauge({ gauge, bar, mark }, value, { min, max }) {
  gauge.hidden = min === null || max === null || value === null;
  if (gauge.hidden) return;
  const percent = v => 100 * Math.min(1, Math.max(0, (v - min) / (max - min)));
  const zero = percent(0);
  const here = percent(value);
  bar.style.left = `${Math.min(zero, here)}%`;
  bar.style.width = `${Math.abs(here - zero)}%`;
  mark.style.left = `${here}%`;
}

// What is applied; beside it what the device says it has, where that is something else.
function showCommand({ name, limit, part }, last, since, old, how) {
  if (!last) return;
  const value = named(last.inputs, name);
  const isOld = since === null || since > old;
  if (value === null) set(part.value, "unknown");
  const text = since === null ? "age –" : `last command, ${duration(since)} ago`;
  showAge(part, isOld ? text : "", isOld);
  const readBack = named(last.read_back, name);
  const tolerance = DIFFERENT * (spanOf(limit) || Math.abs(value));
  const isDifferent = readBack !== null && (value === null || Math.abs(readBack - value) > tolerance);
  set(part.readBack, isDifferent ? `the device has ${written(readBack, how)} ${how.unit}` : "");
}

function showMeasured({ name, part }, last, since, old) {
  const isMissing = !last || named(last.outputs, name) === null;
  const taken = last ? named(last.ages, name) : null;
  const age = taken === null || since === null ? null : taken + since;
  const text = age === null ? "age –" : `age at most ${duration(age)}`;
  showAge(part, isMissing ? "no value" : text, age === null || age > old);
}

// What is old is dimmed, so that it is not taken for fresh.
function showAge({ age, value }, text, isOld) {
  set(age, text);
  value.closest(".card").classList.toggle("old", isOld);
}
