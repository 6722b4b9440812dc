// A strip chart of the last minute on a canvas, limits shaded; and numbers in prefixed units.

const WINDOW = 60;
const PREFIXES = { "-9": "n", "-6": "µ", "-3": "m", 0: "", 3: "k", 6: "M" };
const PREFIXED = ["A", "V", "N", "m", "W", "J", "Pa", "s", "Hz", "C", "F", "ohm", "Ω"];
const LEFT = 58;
const BOTTOM = 20;
const TOP = 18; // a line for the unit
const RIGHT = 4;

// How a signal is shown whose limits have a size and whose values were at most so large: factor, unit and decimals, so
// that four digits of the limit are seen, and of much smaller values a digit or two more.
export function notation(size, largest, unit) {
  const how = notationOf(size || largest || 1, unit);
  const smaller = size > 0 && largest > 0 ? Math.floor(Math.log10(size / largest)) : 0;
  return { ...how, decimals: how.decimals + Math.min(2, Math.max(0, smaller)) };
}

function notationOf(size, unit) {
  let exponent = 0;
  if (PREFIXED.includes(unit) && size > 0) {
    exponent = Math.min(6, Math.max(-9, 3 * Math.floor(Math.log10(size) / 3 + 1e-9)));
  }
  const shown = size / 10 ** exponent;
  const decimals = shown > 0 ? Math.min(6, Math.max(0, 3 - Math.floor(Math.log10(shown) + 1e-9))) : 3;
  const name = unit === "1" || !unit ? "" : PREFIXES[exponent] + (unit === "ohm" ? "Ω" : unit);
  return { factor: 10 ** -exponent, unit: name, decimals };
}

export function written(value, how, decimals = how.decimals) {
  const text = (value * how.factor).toFixed(decimals);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

export function shortened(value, how) {
  return String(Number((value * how.factor).toPrecision(4))).replace("-", "−");
}

function ends(points, limit, held) {
  const values = points.map(([, value]) => value).filter(value => value !== null);
  let low = limit.min ?? 0;
  let high = limit.max ?? Math.max(1, low + 1);
  if (values.length) {
    low = values.reduce((least, value) => Math.min(least, value));
    high = values.reduce((most, value) => Math.max(most, value));
  }
  const bounded = limit.min !== null && limit.max !== null;
  // a command is seen between its limits, and so is what moves over a good part of them
  if (bounded && (held || high - low >= 0.1 * (limit.max - limit.min))) {
    low = Math.min(low, limit.min);
    high = Math.max(high, limit.max);
  }
  const size = bounded ? limit.max - limit.min : Math.max(Math.abs(low), Math.abs(high));
  const least = size > 0 ? 0.02 * size : 1;
  const middle = (high + low) / 2;
  const half = Math.max(high - low, least) / 2;
  const margin = 0.16 * half;
  return [middle - half - margin, middle + half + margin];
}

export function ticks(low, high, most) {
  const rough = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find(multiple => multiple * power >= rough);
  const values = [];
  for (let k = Math.ceil(low / step); k * step <= high; k++) values.push(k * step);
  return { values, step };
}

// points: [[time, value or null], …] in order; now: the right edge; gap: longest distance of two that are joined
export function draw(canvas, points, { now, limit, how, held, gap, colours }) {
  if (!canvas.clientWidth) return;
  const pen = cleared(canvas);
  const [low, high] = ends(points, limit, held);
  const right = canvas.clientWidth - RIGHT;
  const floor = canvas.clientHeight - BOTTOM;
  const x = time => right - (now - time) / WINDOW * (right - LEFT);
  const y = value => floor - (value - low) / (high - low) * (floor - TOP);
  const area = { x, y, low, high, right, floor };

  drawGrid(pen, area, now, how, colours);
  shade(pen, limit.max, bound => bound < high, bound => [TOP, y(bound)], right, colours);
  shade(pen, limit.min, bound => bound > low, bound => [y(bound), floor], right, colours);
  pen.save();
  pen.beginPath();
  pen.rect(LEFT, 0, right - LEFT, floor + 1);
  pen.clip();
  drawSignal(pen, area, points, { now, held, gap, colours });
  pen.restore();
}

export function cleared(canvas) {
  const scale = window.devicePixelRatio || 1;
  const width = Math.round(canvas.clientWidth * scale);
  const height = Math.round(canvas.clientHeight * scale);
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, canvas.clientWidth, canvas.clientHeight);
  return pen;
}

function drawGrid(pen, { x, y, low, high, right, floor }, now, how, colours) {
  pen.font = "11px system-ui, sans-serif";
  pen.fillStyle = colours.muted;
  pen.strokeStyle = colours.grid;
  pen.lineWidth = 1;
  pen.textBaseline = "middle";
  pen.textAlign = "right";
  const { values, step } = ticks(low, high, 6);
  const decimals = Math.max(0, Math.min(9, -Math.floor(Math.log10(step * how.factor) + 1e-9)));
  for (const value of values) {
    line(pen, LEFT, y(value), right, y(value));
    pen.fillText(written(value, how, decimals), LEFT - 6, y(value));
  }
  pen.textBaseline = "alphabetic";
  if (how.unit) pen.fillText(`[${how.unit}]`, LEFT - 6, TOP - 7);
  const alignments = { 60: "left", 0: "right" };
  for (const ago of [60, 45, 30, 15, 0]) {
    line(pen, x(now - ago), TOP, x(now - ago), floor);
    pen.textAlign = alignments[ago] ?? "center";
    pen.fillText(ago === 0 ? "now" : `−${ago} s`, x(now - ago), floor + 15);
  }
}

function drawSignal(pen, { x, y }, points, { now, held, gap, colours }) {
  pen.strokeStyle = colours.signal;
  pen.fillStyle = colours.signal;
  pen.lineWidth = 1.8;
  pen.lineJoin = "round";
  pen.beginPath();
  let last = null;
  for (const [time, value] of points) {
    if (value === null) {
      last = null;
      continue;
    }
    if (last === null || time - last.time > gap) pen.moveTo(x(time), y(value));
    else if (held) pen.lineTo(x(time), y(last.value));
    pen.lineTo(x(time), y(value));
    last = { time, value };
  }
  pen.stroke();
  if (last === null || now - last.time >= gap) return;
  pen.beginPath();
  pen.arc(x(last.time) - 2, y(last.value), 3, 0, 7);
  pen.fill();
}

export function line(pen, x0, y0, x1, y1) {
  pen.beginPath();
  pen.moveTo(x0, Math.round(y0) + 0.5);
  pen.lineTo(x1, Math.round(y1) + 0.5);
  pen.stroke();
}

function shade(pen, limit, isSeen, span, right, colours) {
  if (limit === null || !isSeen(limit)) return;
  const [from, to] = span(limit).map(v => Math.max(TOP, v));
  const edge = from === TOP ? to : from;
  pen.save();
  pen.globalAlpha = 0.16;
  pen.fillStyle = colours.forbidden;
  pen.fillRect(LEFT, from, right - LEFT, to - from);
  pen.restore();
  pen.save();
  pen.strokeStyle = colours.forbidden;
  pen.setLineDash([5, 4]);
  line(pen, LEFT, edge, right, edge);
  pen.restore();
}
