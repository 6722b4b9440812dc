// Shows what `ppy rig watch` streams. Whatever comes from the rig is text and numbers, and never becomes HTML.

import { draw, notation, shortened, written } from "./chart.js";

const SILENCE = 800; // ms without a word from `ppy rig watch`, which sends something every 250
const WINDOW = 60; // s
const NEAR = 0.05; // of the span between the limits
const EVENTS = 100;
const place = id => document.getElementById(id);
const words = { idle: "idle", running: "running", safe: "safe state", unknown: "connecting", lost: "no contact" };

let rig = null, samples = [], signals = new Map(), known = { state: "unknown", reason: "", client: "" };
let contact = { server: false, samples: false }, heard = null, offset = null, everHeard = false;
const opened = performance.now();

const clock = () => performance.now() / 1000 - offset; // the clock that samples are stamped with
const meta = name => document.querySelector(`meta[name=${name}]`).content;
const set = (element, text) => { if (element.textContent !== text) element.textContent = text; };

function make(tag, name, ...children) {
  const element = document.createElement(tag);
  if (name) element.className = name;
  element.append(...children);
  return element;
}

// --- what is streamed ----------------------------------------------------------------------------------------------

const source = new EventSource("/stream");
source.onmessage = ({ data }) => {
  const message = JSON.parse(data);
  if (message.instance !== meta("rig-instance")) { // started again: it does not know this page's stop button
    source.close();
    location.reload();
    return;
  }
  heard = performance.now();
  if (message.first) {
    samples = [];
    offset = null;
    place("events").replaceChildren();
  }
  const seen = heard / 1000 - message.now;
  offset = offset === null ? seen : Math.min(offset + 1e-5, seen); // the quickest message is nearest the truth
  for (const item of message.items) take[item.kind]?.(item);
  check();
};

const take = {
  rig(item) {
    rig = item;
    build();
  },
  contact(item) { contact = item; if (item.server) everHeard = true; },
  state(item) { known = item; },
  event(item) { addEvent(item); },
  sample(item) {
    samples.push(item);
    while (samples.length && samples[0].at < item.at - WINDOW - 1) samples.shift();
  },
};

function addEvent({ what, when, text }) {
  const time = make("time", "", new Date(1000 * when).toLocaleTimeString([], { hour12: false }));
  const good = what === "running" || /^(contact with|samples arrive)/.test(text);
  place("events").prepend(make("li", good ? "good" : what, time, make("span", "", text)));
  while (place("events").children.length > EVENTS) place("events").lastChild.remove();
}

// --- cards ---------------------------------------------------------------------------------------------------------

function build() {
  signals = new Map();
  for (const role of ["inputs", "outputs"]) {
    const cards = Object.entries(rig[role]).map(([name, unit]) => card(role, name, unit));
    place(role).replaceChildren(...(cards.length ? cards : [make("p", "none", "none")]));
  }
}

function card(role, name, unit) {
  const limit = { min: null, max: null, ...rig.limits[name] };
  const part = {
    value: make("span", "number", "–"), unit: make("span", "unit"), badge: make("span", "badge"),
    bar: make("i"), mark: make("b"), low: make("span"), high: make("span"), age: make("p", "age"),
    canvas: make("canvas"),
  };
  const gauge = make("div", "gauge", part.bar, part.mark);
  gauge.hidden = limit.min === null || limit.max === null;
  part.canvas.setAttribute("role", "img");
  part.canvas.setAttribute("aria-label", `${name} over the last minute`);
  const body = make("article", "card",
    make("div", "top", make("h3", "", name), part.badge, make("div", "value", part.value, part.unit)),
    gauge, make("div", "limits", part.low, part.high), part.canvas, part.age);
  body.dataset.signal = name;
  const size = Math.max(Math.abs(limit.min ?? 0), Math.abs(limit.max ?? 0));
  signals.set(`${role}/${name}`, { role, name, unit, limit, size, part, body });
  return body;
}

function judged(value, { min, max }) {
  if (value === null) return "";
  if ((min !== null && value < min) || (max !== null && value > max)) return "beyond";
  const span = min !== null && max !== null ? max - min : Math.abs(max ?? min ?? 0);
  const close = limit => limit !== null && limit !== 0 && Math.abs(value - limit) < NEAR * span; // 0 is at rest
  return close(min) || close(max) ? "near" : "";
}

function duration(seconds) {
  if (seconds === null || !(seconds >= 0)) return "–";
  return seconds < 1 ? `${Math.round(1000 * seconds)} ms` : seconds < 100 ? `${seconds.toFixed(1)} s`
    : `${Math.round(seconds)} s`;
}

function colours(role) {
  const style = getComputedStyle(document.documentElement), of = name => style.getPropertyValue(`--${name}`).trim();
  return { signal: of(role === "inputs" ? "command" : "measured"), muted: of("muted"), grid: of("grid"),
    forbidden: of("forbidden") };
}

function show(signal, now, last, paint) {
  const { role, name, unit, limit, part, body } = signal;
  const points = samples.map(sample => [sample.at, sample[role][name] ?? null]);
  const value = last ? last[role][name] ?? null : null;
  const largest = points.reduce((most, [, v]) => Math.max(most, Math.abs(v ?? 0)), 0);
  const how = notation(signal.size, largest, unit);
  set(part.value, value === null ? "–" : written(value, how));
  set(part.unit, how.unit);
  const limits = { low: ["min", limit.min], high: ["max", limit.max] };
  for (const [end, [word, bound]] of Object.entries(limits)) {
    set(part[end], bound === null ? "" : `${word} ${shortened(bound, how)} ${how.unit}`);
  }
  const verdict = judged(value, limit);
  body.className = `card ${verdict}`;
  set(part.badge, { near: "near its limit", beyond: "beyond its limit" }[verdict] ?? "");
  if (limit.min !== null && limit.max !== null && value !== null) {
    const at = v => 100 * Math.min(1, Math.max(0, (v - limit.min) / (limit.max - limit.min)));
    const zero = at(0), here = at(value);
    part.bar.style.left = `${Math.min(zero, here)}%`;
    part.bar.style.width = `${Math.abs(here - zero)}%`;
    part.mark.style.left = `${here}%`;
  }
  const waited = last ? now - last.at : null;
  const age = last === null ? null : role === "inputs" ? waited : (last.ages[name] ?? null) === null ? null
    : last.ages[name] + waited;
  const old = Math.max(0.5, 3 * rig.period);
  set(part.age, role === "inputs" ? "" : value === null ? "no value" : `age ${duration(age)}`);
  part.age.classList.toggle("old", role === "outputs" && (age === null || age > old));
  part.age.hidden = role === "inputs";
  draw(part.canvas, points, { now, limit, how, held: role === "inputs", gap: old, colours: paint });
}

// --- contact, state and drawing ------------------------------------------------------------------------------------

function alarm() {
  const silent = performance.now() - (heard ?? opened);
  if (silent > SILENCE) {
    return ["ppy rig watch does not answer.", "This page shows old values, and its stop button may not work: use the "
      + "emergency stop at the rig."];
  }
  if (heard !== null && !contact.server && (everHeard || performance.now() - opened > SILENCE)) {
    return ["No contact with the rig’s server.", "What is shown is old, and stop may not get through. The rig’s own "
      + "watchdog brings it to its safe state."];
  }
  if (heard !== null && contact.server && !contact.samples) {
    return ["No samples arrive.", "The server answers, but what is shown is old."];
  }
  return null;
}

function check() {
  const found = alarm();
  const state = found ? "lost" : known.state in words ? known.state : "unknown";
  if (place("alarm").hidden !== !found) place("alarm").hidden = !found;
  set(place("alarm-title"), found ? found[0] : "");
  set(place("alarm-text"), found ? found[1] : "");
  const last = samples.length && offset !== null ? clock() - samples[samples.length - 1].at : null;
  set(place("alarm-since"), found && last !== null ? `Last sample ${last.toFixed(1)} s ago.` : "");
  if (state !== "safe" && place("pressed").className === "done") place("pressed").textContent = "";
  document.body.dataset.state = state;
  set(place("state"), found && known.state !== "unknown" ? `no contact (was ${words[known.state] ?? "unknown"})`
    : words[state]);
  reason(state);
  set(place("client"), known.client || "none");
  document.title = `${words[state]} – rig`;
}

function reason(state) {
  const text = state === "safe" ? known.reason : "";
  if (place("reason").dataset.text === text) return;
  place("reason").dataset.text = text;
  const hint = state === "safe" ? [make("small", "", "latched; `ppy rig acknowledge` releases it")] : [];
  place("reason").replaceChildren(text, ...hint);
}

function render() {
  check();
  if (!rig || offset === null) return;
  const now = clock(), last = samples.length ? samples[samples.length - 1] : null;
  const paints = { inputs: colours("inputs"), outputs: colours("outputs") };
  for (const signal of signals.values()) show(signal, now, last, paints[signal.role]);
  const age = last === null || last.command_age === null ? null : last.command_age + now - last.at;
  set(place("command"), known.client ? duration(age) : "–");
  const recent = samples.filter(sample => sample.at > now - 2).length / 2;
  set(place("rate"), `${recent.toFixed(recent < 10 ? 1 : 0)} per s`);
}

// --- the one command -----------------------------------------------------------------------------------------------

place("stop").addEventListener("click", async () => {
  const told = place("pressed");
  told.className = "";
  told.textContent = "Stopping…";
  try {
    const answer = await fetch("/stop", { method: "POST", headers: { "X-Rig-Token": meta("rig-token") },
      signal: AbortSignal.timeout(4000) });
    const { confirmed } = await answer.json();
    if (!confirmed) throw new Error("not confirmed");
    told.textContent = "Stopped: confirmed.";
    known = { ...known, state: "safe" };
    told.className = "done";
  } catch {
    told.className = "bad";
    told.textContent = "Not confirmed! Press again, or use the emergency stop at the rig.";
  }
});

setInterval(check, 100);
setInterval(render, 60);
