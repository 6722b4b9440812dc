// Shows what `ppy rig watch` streams. Whatever comes from the rig is text and numbers, and never becomes HTML.

import { build, show } from "./cards.js";
import { duration, make, place, set } from "./elements.js";
import { follow } from "./stream.js";
import { showParameters } from "./tuning.js";

const SILENCE = 0.8; // s without an answer of `ppy rig watch`
const DRIFT = 1e-3; // s that the clocks of page and program may part in a second, as in transit.py
const WINDOW = 60; // s
const FRAME = 60; // ms between two drawings
const OVERDUE = 1000; // ms in which a stop is confirmed, unless something is wrong
const GIVEN_UP = 4000; // ms that a stop may take, which waits 2 s for the rig's server
const EVENTS = 100;
const LABELS = new Map(Object.entries({
  idle: "idle",
  running: "running",
  stopping: "stopping…",
  safe: "safe",
  "not reached": "NOT REACHED",
  unknown: "connecting",
}));
const LATCHED = ["stopping", "safe", "not reached"];
const EMERGENCY = "use the emergency stop at the rig";
const meta = name => document.querySelector(`meta[name=${name}]`).content;

let rig = null;
let samples = [];
let condition = { state: "unknown", reason: "", client: "", latch: "", reached: null, alarm: "", verified: true, operator: "" };
let contact = { server: false, samples: false };
let offset = null; // of this page's clock from the one that samples are stamped with, s; it is no less
let answered = null; // that clock when the newest answer was made
let isStale = false; // this page is of a program before the one that answers
let wasInContact = false;
let press = null; // of the stop button, until the rig is released
let newest = 0; // number of the newest item that the answer to it has
const opened = performance.now();

const now = () => performance.now() / 1000;
const clock = () => now() - offset; // never behind the one that samples are stamped with: ages are at most these

// --- what is streamed ----------------------------------------------------------------------------------------------

function take(update, asked) {
  if (update) {
    if (update.instance !== meta("rig-instance")) startAnew();
    else receive(update, asked / 1000);
  }
  check();
  if (document.hidden) render(); // which is not animated
}

// Another program answers, which does not know this page's stop button. Whoever has pressed it has to see that.
function startAnew() {
  if (!isStale && !press) location.reload();
  isStale = true;
}

function receive(update, asked) {
  synchronise(asked - update.now, now() - update.now, update.now - (answered ?? update.now));
  answered = update.now;
  if (update.first) {
    samples = [];
    place("events").replaceChildren();
  }
  for (const item of update.items) takers[item.kind](item, update.serial);
}

// The clock of the program was read after it was asked and before its answer came (Cristian, 1989).
function synchronise(least, most, elapsed) {
  const loosened = offset === null ? null : offset - DRIFT * Math.abs(elapsed);
  const isConsistent = loosened !== null && least <= loosened && loosened <= most;
  offset = isConsistent ? loosened : least;
}

const takers = {
  rig(item) {
    rig = item;
    build(rig);
  },
  contact(item) {
    contact = item;
    wasInContact ||= item.server;
  },
  state(item, serial) {
    if (serial >= newest) condition = item;
  },
  sample(item) {
    samples.push(item);
    while (samples[0].at < item.at - WINDOW - 1) samples.shift();
  },
  parameters(item) {
    showParameters(item.parameters, meta("rig-token"));
  },
  event({ what, when, text }) {
    const time = make("time", "", new Date(1000 * when).toLocaleTimeString([], { hour12: false }));
    const isGood = what === "running" || /^(contact with|samples arrive)/.test(text);
    const kind = isGood ? "good" : what.replaceAll(" ", "-");
    place("events").prepend(make("li", kind, time, make("span", "", text)));
    while (place("events").children.length > EVENTS) place("events").lastChild.remove();
  },
};

// --- alarms and state ----------------------------------------------------------------------------------------------

// Whether what is shown is old, and why; null if it is not.
function lostContact() {
  if (isStale) {
    return ["This page is of an earlier ppy rig watch.", `Its stop button does not work: reload it, or ${EMERGENCY}.`];
  }
  const began = performance.now() - opened > 1000 * SILENCE;
  if (answered === null ? began : clock() - answered > SILENCE) {
    return ["ppy rig watch does not answer.",
      `This page shows old values, and its stop button may not work: ${EMERGENCY}.`];
  }
  if (answered !== null && !contact.server && (wasInContact || began)) {
    if (!wasInContact) {
      return ["No contact with the rig’s server: it does not run there, or the keys do not match.",
        `Stop does not get through: ${EMERGENCY}.`];
    }
    return ["No contact with the rig’s server.",
      `What is shown is old, and stop may not get through: ${EMERGENCY}.`];
  }
  if (answered !== null && contact.server && !contact.samples) {
    return ["No samples arrive.", "The server answers, but what is shown is old."];
  }
  return null;
}

// What the rig wants an operator to know, until it is acknowledged.
function rigAlarm() {
  if (condition.state === "not reached") {
    const said = condition.alarm && ` The rig says: ${condition.alarm}.`;
    return ["NOT REACHED: nobody knows that the rig is safe.", `Use the emergency stop at the rig.${said}`];
  }
  if (condition.alarm) return [`Alarm: ${condition.alarm}.`, "“ppy rig acknowledge” clears it."];
  return null;
}

const label = () => LABELS.get(condition.state) ?? condition.state;

// How long the safe state took; empty where there is none, or nobody knows.
function reachedAfter() {
  const isTimed = condition.state === "safe" && condition.reached !== null;
  const doubt = condition.verified ? "" : "; commanded safe, not verified";
  return isTimed ? `reached after ${duration(condition.reached)}${doubt}` : "";
}

function check() {
  const lost = lostContact();
  const alarm = rigAlarm();
  showAlarms([alarm, lost].filter(Boolean));
  showAge(lost);
  showState(lost);
  showPress();
  const isKnown = !lost || condition.state === "not reached"; // which stays true until somebody clears it
  const words = [isKnown ? label() : "", lost ? "no contact" : ""].filter(Boolean);
  document.title = `${alarm ? "ALARM: " : ""}${words.join(", ")} – rig`;
  document.body.dataset.state = lost ? "lost" : condition.state.replaceAll(" ", "-");
}

function showAlarms(alarms) {
  const element = place("alarm");
  element.hidden = alarms.length === 0;
  const text = JSON.stringify(alarms);
  if (element.dataset.text === text) return;
  element.dataset.text = text;
  element.replaceChildren(...alarms.map(([title, more]) => make("p", "", make("strong", "", title), ` ${more}`)));
}

function showAge(lost) {
  const last = samples.at(-1);
  set(place("since"), lost && last && offset !== null ? `Last sample ${duration(ageOf(last))} ago.` : "");
}

function showState(lost) {
  const was = condition.state === "unknown" ? "" : `was ${label()}`;
  const more = lost ? was : reachedAfter();
  set(place("word"), lost ? "no contact" : label());
  set(place("more"), more && ` (${more})`);
  const operator = condition.operator && ` (${condition.operator})`;
  set(place("client"), condition.client ? condition.client + operator : "none");
  set(place("reason"), isLatched() ? condition.reason : "");
  const name = condition.latch && ` (${condition.latch})`;
  set(place("hint"), isLatched() ? `latched${name}; “ppy rig acknowledge” releases it` : "");
}

// --- drawing -------------------------------------------------------------------------------------------------------

// How long ago a sample was sent by the rig, s, at most; null if nobody knows.
function ageOf(sample) {
  return sample.transit === null ? null : sample.transit + Math.max(0, clock() - sample.at);
}

function render() {
  if (!rig || offset === null) return;
  const last = samples.at(-1) ?? null;
  const age = last && ageOf(last);
  show(samples, clock(), age, rig.period);
  const isCommanded = condition.client && last && last.command_age !== null && age !== null;
  set(place("command"), isCommanded ? `${duration(last.command_age + age)} ago` : "–");
  const recent = samples.filter(sample => sample.at > clock() - 2).length / 2;
  set(place("rate"), `${recent.toFixed(recent < 10 ? 1 : 0)} per s`);
}

let drawn = 0;

function animate(time) {
  requestAnimationFrame(animate);
  if (time - drawn < FRAME) return;
  drawn = time;
  render();
}

// --- the one command -----------------------------------------------------------------------------------------------

// The request outlives the page, so that it is sent although the tab is closed at once.
async function stop() {
  const pressed = { at: performance.now(), latch: condition.latch, isAnswered: false, wasLatched: false, failure: "" };
  press = pressed;
  check();
  try {
    const answer = await fetch("/stop", {
      method: "POST",
      headers: { "X-Rig-Token": meta("rig-token") },
      keepalive: true,
      priority: "high",
      signal: AbortSignal.timeout(GIVEN_UP),
    });
    if (answer.status === 403) isStale = true;
    if (!answer.ok) throw new Error("not taken");
    const { serial, ...state } = await answer.json();
    newest = serial;
    condition = state;
    pressed.isAnswered = true;
  } catch {
    pressed.failure = `NOT CONFIRMED: press again, or ${EMERGENCY}.`;
  }
  check();
}

const isLatched = () => LATCHED.includes(condition.state);

// Whether the state that is shown has come of the press.
const isMeant = () => press.isAnswered || (isLatched() && condition.latch !== press.latch);

// What became of the press, as the rig says it: it is never called done before the rig is safe.
function outcome() {
  if (!isMeant() && (press.failure || isStale)) return [press.failure || `NOT CONFIRMED: ${EMERGENCY}.`, "bad"];
  if (condition.state === "not reached") return [`NOT REACHED: ${EMERGENCY}.`, "bad"];
  if (isMeant() && condition.state === "safe") {
    return [`Safe${reachedAfter() && ": "}${reachedAfter()}.`, "done"];
  }
  if (performance.now() - press.at > OVERDUE) return [`NOT CONFIRMED yet: press again, or ${EMERGENCY}.`, "bad"];
  return ["Stopping…", ""];
}

function showPress() {
  if (press?.wasLatched && !isLatched()) press = null; // released
  if (press) press.wasLatched ||= isMeant() && isLatched();
  const [text, kind] = press ? outcome() : ["", ""];
  set(place("pressed"), text);
  place("pressed").className = kind;
}

place("stop").addEventListener("click", stop);
document.addEventListener("freeze", () => {
  document.title = "not live – rig"; // until the browser lets this tab run again
});
setInterval(check, 100);
requestAnimationFrame(animate);
follow(meta("rig-instance"), take);
