// Draws what the archive of a rig holds in a span of time. Whatever comes from it is text and numbers, never HTML.

import { cleared, line, notation, ticks, written } from "./chart.js";
import { make, place, set } from "./elements.js";

const LEFT = 64;
const RIGHT = 8;
const TOP = 18; // a line for the unit
const BOTTOM = 20;
const HATCH = 7; // px between two lines
const LEAST = 0.01; // s of a span
const STEPS = [0.01, 0.1, 1, 5, 15, 60, 300, 900, 3600, 10800, 43200, 86400, 604800]; // s between two times that are written

let shown = null; // the newest answer
let drag = null; // [canvas, first x, present x]

const colour = name => getComputedStyle(document.body).getPropertyValue(`--${name}`).trim();
const width = canvas => canvas.clientWidth - LEFT - RIGHT;
const timeAt = (canvas, x) => shown.span[0] + (x - LEFT) / width(canvas) * (shown.span[1] - shown.span[0]);

async function load(span) {
  const query = span ? `?from=${Math.max(0, span[0]).toFixed(6)}&to=${Math.max(0, span[1]).toFixed(6)}` : "";
  try {
    const answer = await fetch(`/archive${query}`);
    const read = await answer.json();
    if (!answer.ok) throw new Error(read.error);
    shown = read;
    show();
  } catch (error) {
    set(place("span"), `The archive cannot be read: ${error.message}`);
  }
}

function show() {
  set(place("span"), `${stamp(shown.span[0])} to ${stamp(shown.span[1])}`);
  const names = shown.signals.map(signal => signal.name).join();
  if (place("signals").dataset.names !== names) build(names);
  render();
  const gaps = shown.gaps.map(gap => {
    const lost = gap.lost ? `${gap.lost} samples ` : "";
    return item(gap.begin, gap.end, `${lost}${gap.reason}`, "gap");
  });
  place("gaps").replaceChildren(...(gaps.length ? gaps : [make("li", "", "none")]));
  const events = shown.events.map(event => item(event.time, null, event.text, event.what)).reverse();
  if (shown.omitted) events.push(make("li", "", `and ${shown.omitted} earlier ones`));
  place("entries").replaceChildren(...(events.length ? events : [make("li", "", "none")]));
}

function item(from, to, text, kind) {
  const time = make("time", "", stamp(from));
  if (to !== null) time.append(` to ${stamp(to)}`);
  return make("li", kind, time, make("span", "", text));
}

function build(names) {
  place("signals").dataset.names = names;
  place("signals").replaceChildren(...shown.signals.map(signal => {
    const canvas = make("canvas", "");
    canvas.dataset.signal = signal.name;
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${signal.name} over time`);
    canvas.addEventListener("pointerdown", event => begin(canvas, event));
    canvas.addEventListener("pointermove", event => move(canvas, event));
    canvas.addEventListener("pointerup", event => end(canvas, event));
    canvas.addEventListener("pointercancel", () => { drag = null; render(); });
    canvas.addEventListener("dblclick", () => load(null));
    return make("figure", signal.role, make("figcaption", "", signal.name), canvas);
  }));
}

function begin(canvas, event) {
  canvas.setPointerCapture(event.pointerId);
  drag = [canvas, event.offsetX, event.offsetX];
}

function move(canvas, event) {
  if (!drag) return;
  drag[2] = event.offsetX;
  render();
}

function end(canvas) {
  if (!drag) return;
  const [from, to] = drag.slice(1).sort((a, b) => a - b);
  drag = null;
  if (to - from > 4) load([timeAt(canvas, from), Math.max(timeAt(canvas, to), timeAt(canvas, from) + LEAST)]);
  else render();
}

function render() {
  if (!shown) return;
  const canvases = place("signals").querySelectorAll("canvas");
  shown.signals.forEach((signal, k) => draw(canvases[k], signal));
}

function draw(canvas, signal) {
  if (!canvas.clientWidth) return;
  const pen = cleared(canvas);
  const floor = canvas.clientHeight - BOTTOM;
  const right = canvas.clientWidth - RIGHT;
  const [from, to] = shown.span;
  const x = time => LEFT + (time - from) / (to - from || 1) * width(canvas);
  const low = signal.low.reduce((a, b) => Math.min(a, b), Infinity);
  const high = signal.high.reduce((a, b) => Math.max(a, b), -Infinity);
  const [bottom, top] = low <= high ? widened(low, high) : [0, 1];
  const y = value => floor - (value - bottom) / (top - bottom) * (floor - TOP);
  drawGrid(pen, signal, { x, y, bottom, top, floor, right });
  pen.save();
  pen.beginPath();
  pen.rect(LEFT, TOP, right - LEFT, floor - TOP);
  pen.clip();
  for (const gap of shown.gaps) hatch(pen, x(gap.begin), x(gap.end), floor);
  drawEvents(pen, x, floor);
  drawBand(pen, signal, x, y);
  if (drag && drag[0] === canvas) {
    pen.globalAlpha = 0.25;
    pen.fillStyle = colour("measured");
    pen.fillRect(drag[1], TOP, drag[2] - drag[1], floor - TOP);
  }
  pen.restore();
}

function widened(low, high) {
  const half = (high - low) / 2 || Math.abs(high) / 50 || 1;
  const middle = (high + low) / 2;
  return [middle - 1.1 * half, middle + 1.1 * half];
}

function drawGrid(pen, signal, { x, y, bottom, top, floor, right }) {
  pen.font = "11px system-ui, sans-serif";
  pen.fillStyle = colour("muted");
  pen.strokeStyle = colour("grid");
  pen.lineWidth = 1;
  pen.textBaseline = "middle";
  pen.textAlign = "right";
  const how = notation(Math.max(Math.abs(bottom), Math.abs(top)), 0, signal.unit);
  const { values, step } = ticks(bottom, top, 5);
  const decimals = Math.max(0, Math.min(9, -Math.floor(Math.log10(step * how.factor) + 1e-9)));
  for (const value of values) {
    line(pen, LEFT, y(value), right, y(value));
    pen.fillText(written(value, how, decimals), LEFT - 6, y(value));
  }
  pen.textBaseline = "alphabetic";
  if (how.unit) pen.fillText(`[${how.unit}]`, LEFT - 6, TOP - 7);
  pen.textAlign = "center";
  const [from, to] = shown.span;
  const least = (to - from) * 110 / (right - LEFT); // px of a time
  const every = STEPS.find(one => one >= least) ?? Math.ceil(least / 604800) * 604800;
  const zone = 60 * new Date(1000 * from).getTimezoneOffset();
  for (let time = Math.ceil((from - zone) / every) * every + zone; time <= to; time += every) {
    line(pen, x(time), TOP, x(time), floor);
    pen.fillText(clock(time, every), x(time), floor + 15);
  }
}

function drawBand(pen, signal, x, y) {
  pen.fillStyle = pen.strokeStyle = colour(signal.role === "inputs" ? "command" : "measured");
  pen.lineWidth = 1.5;
  pen.lineJoin = "round";
  const part = Math.max((shown.span[1] - shown.span[0]) / 900, LEAST / 900);
  const isBroken = k => k === 0 || signal.time[k] - signal.time[k - 1] > 1.5 * part && isGap(signal.time[k - 1], signal.time[k]);
  pen.beginPath();
  signal.time.forEach((time, k) => {
    const middle = (signal.low[k] + signal.high[k]) / 2;
    if (isBroken(k)) pen.moveTo(x(time), y(middle));
    else pen.lineTo(x(time), y(middle));
    pen.moveTo(x(time), y(signal.low[k]));
    pen.lineTo(x(time), y(signal.high[k]) - 0.5);
    pen.moveTo(x(time), y(middle));
  });
  pen.stroke();
}

const isGap = (from, to) => shown.gaps.some(gap => gap.begin < to && gap.end > from);

function hatch(pen, from, to, floor) {
  pen.save();
  pen.beginPath();
  pen.rect(from, TOP, Math.max(2, to - from), floor - TOP);
  pen.clip();
  pen.strokeStyle = colour("forbidden");
  pen.globalAlpha = 0.45;
  pen.beginPath();
  const height = floor - TOP;
  const first = Math.max(from, 0) - height;
  const last = Math.min(Math.max(to, from + 2), 1e4);
  for (let place = Math.floor(first / HATCH) * HATCH; place < last; place += HATCH) {
    pen.moveTo(place, floor);
    pen.lineTo(place + height, TOP);
  }
  pen.stroke();
  pen.restore();
}

function drawEvents(pen, x, floor) {
  pen.save();
  pen.setLineDash([2, 3]);
  for (const event of shown.events) {
    if (event.what !== "state") continue;
    pen.strokeStyle = colour(["stopping", "safe", "not reached"].includes(event.text) ? "forbidden" : "muted");
    line(pen, x(event.time), TOP, x(event.time), floor);
  }
  pen.restore();
}

function clock(time, every) {
  const date = new Date(1000 * time);
  if (every >= 86400) return date.toLocaleDateString();
  const text = date.toLocaleTimeString([], { hour12: false });
  return every < 1 ? `${text}.${String(date.getMilliseconds()).padStart(3, "0")}` : text;
}

function stamp(time) {
  const date = new Date(1000 * time);
  const part = String(date.getMilliseconds()).padStart(3, "0");
  return `${date.toLocaleDateString()} ${date.toLocaleTimeString([], { hour12: false })}.${part}`;
}

function newest(seconds) {
  return () => load(null).then(() => shown && load([shown.whole[1] - seconds, shown.whole[1]]));
}

// Move by a share of the span, and make it longer or shorter about its middle.
function change(shift, factor) {
  return () => {
    if (!shown) return;
    const length = shown.span[1] - shown.span[0];
    const middle = (shown.span[0] + shown.span[1]) / 2 + shift * length;
    const half = Math.max(length * factor, LEAST) / 2;
    load([middle - half, middle + half]);
  };
}

place("whole").addEventListener("click", () => load(null));
place("hour").addEventListener("click", newest(3600));
place("minute").addEventListener("click", newest(60));
place("earlier").addEventListener("click", change(-0.5, 1));
place("later").addEventListener("click", change(0.5, 1));
place("closer").addEventListener("click", change(0, 0.5));
place("farther").addEventListener("click", change(0, 2));
window.addEventListener("resize", render);
load(null);
