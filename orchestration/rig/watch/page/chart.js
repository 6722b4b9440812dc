// A strip chart of the last minute on a canvas, limits shaded; and numbers in prefixed units.

const WINDOW = 60;
const PREFIXES = { "-9": "n", "-6": "µ", "-3": "m", 0: "", 3: "k", 6: "M" };
const PREFIXED = ["A", "V", "N", "m", "W", "J", "Pa", "s", "Hz", "C", "F", "ohm", "Ω"];
const LEFT = 58, BOTTOM = 20, TOP = 6, RIGHT = 4;

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
  let low = Infinity, high = -Infinity;
  for (const [, value] of points) {
    if (value !== null) { low = Math.min(low, value); high = Math.max(high, value); }
  }
  if (low > high) { low = limit.min ?? 0; high = limit.max ?? Math.max(1, low + 1); }
  const bounded = limit.min !== null && limit.max !== null;
  // a command is seen between its limits, and so is what moves over a good part of them
  if (bounded && (held || high - low >= 0.1 * (limit.max - limit.min))) {
    low = Math.min(low, limit.min); high = Math.max(high, limit.max);
  }
  const size = bounded ? limit.max - limit.min : Math.max(Math.abs(low), Math.abs(high));
  const least = size > 0 ? 0.02 * size : 1;
  if (high - low < least) { const middle = (high + low) / 2; low = middle - least / 2; high = middle + least / 2; }
  const margin = 0.08 * (high - low);
  return [low - margin, high + margin];
}

function ticks(low, high, most) {
  const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find(m => m * power >= rough);
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high; k++) found.push(k * step);
  return { found, step };
}

// points: [[time, value or null], …] in order; now: the right edge; period: longest distance that is no gap
export function draw(canvas, points, { now, limit, how, held, gap, colours }) {
  const scale = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  if (!width) return;
  if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) {
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  const [low, high] = ends(points, limit, held);
  const x = t => width - RIGHT - (now - t) / WINDOW * (width - LEFT - RIGHT);
  const y = v => height - BOTTOM - (v - low) / (high - low) * (height - TOP - BOTTOM);
  const floor = height - BOTTOM, right = width - RIGHT;

  pen.font = "11px system-ui, sans-serif";
  pen.fillStyle = colours.muted;
  pen.strokeStyle = colours.grid;
  pen.lineWidth = 1;
  pen.textBaseline = "middle";
  pen.textAlign = "right";
  const { found, step } = ticks(low, high, 6);
  const decimals = Math.max(0, Math.min(9, -Math.floor(Math.log10(step * how.factor) + 1e-9)));
  for (const tick of found) {
    line(pen, LEFT, y(tick), right, y(tick));
    pen.fillText(written(tick, how, decimals), LEFT - 6, y(tick));
  }
  pen.textBaseline = "alphabetic";
  for (const ago of [60, 45, 30, 15, 0]) {
    line(pen, x(now - ago), TOP, x(now - ago), floor);
    pen.textAlign = ago === 60 ? "left" : ago === 0 ? "right" : "center";
    pen.fillText(ago === 0 ? "now" : `−${ago} s`, x(now - ago), height - 5);
  }
  shade(pen, limit.max, v => v < high, v => [TOP, y(v)], right, colours);
  shade(pen, limit.min, v => v > low, v => [y(v), floor], right, colours);

  pen.save();
  pen.beginPath();
  pen.rect(LEFT, 0, right - LEFT, floor + 1);
  pen.clip();
  pen.strokeStyle = colours.signal;
  pen.lineWidth = 1.8;
  pen.lineJoin = "round";
  pen.beginPath();
  let last = null;
  for (const [t, value] of points) {
    if (value === null) { last = null; continue; }
    if (last === null || t - last[0] > gap) pen.moveTo(x(t), y(value));
    else {
      if (held) pen.lineTo(x(t), y(last[1]));
      pen.lineTo(x(t), y(value));
    }
    last = [t, value];
  }
  pen.stroke();
  if (last !== null && now - last[0] < gap) {
    pen.fillStyle = colours.signal;
    pen.beginPath();
    pen.arc(x(last[0]) - 2, y(last[1]), 3, 0, 7);
    pen.fill();
  }
  pen.restore();
}

function line(pen, x0, y0, x1, y1) {
  pen.beginPath();
  pen.moveTo(x0, Math.round(y0) + 0.5);
  pen.lineTo(x1, Math.round(y1) + 0.5);
  pen.stroke();
}

function shade(pen, limit, isSeen, span, right, colours) {
  if (limit === null || !isSeen(limit)) return;
  const [from, to] = span(limit).map(v => Math.max(TOP, v)), edge = from === TOP ? to : from;
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
