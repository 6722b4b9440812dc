// Tunable parameters of the run beside the rig: their values, and a form each that moves one at a limited rate.

import { make, place, set } from "./elements.js";

const GIVEN_UP = 4000; // ms that an answer may take
const key = location.hash.slice(1); // of the address that the terminal shows, and nobody else knows
const rows = new Map();
const number = value => String(Number(value.toPrecision(6)));

export function showParameters(parameters, token) {
  const names = Object.keys(parameters);
  place("tuning").hidden = names.length === 0;
  set(place("tuning-hint"), key ? "" : "To move them, open the address that ppy rig watch shows in its terminal.");
  if (names.join() !== [...rows.keys()].join()) {
    rows.clear();
    for (const name of names) rows.set(name, row(name, parameters[name], token));
    place("parameters").replaceChildren(...[...rows.values()].map(each => each.body));
  }
  for (const name of names) {
    const { value, target, unit } = parameters[name];
    const goal = value === target ? "" : ` → ${number(target)}`;
    set(rows.get(name).value, `${number(value)}${goal} ${unit === "1" ? "" : unit}`.trim());
  }
}

function row(name, { unit, min, max, doc }, token) {
  const value = make("span", "number");
  const wanted = field(`new value of ${name}`, "new value");
  const slew = field(`slew rate of ${name} per second`, "per s");
  const button = make("button", "set", "Set");
  const said = make("p", "said");
  said.setAttribute("role", "status");
  button.type = "button";
  for (const each of [wanted, slew, button]) each.disabled = !key;
  const bounds = [min === null ? "" : `min ${number(min)}`, max === null ? "" : `max ${number(max)}`].join(" ").trim();
  const about = make("p", "muted", [doc, bounds, unit === "1" ? "" : unit].filter(Boolean).join(" · "));
  button.addEventListener("click", async () => {
    const rate = slew.value.trim() ? Number(slew.value) : null;
    if (!wanted.value.trim() || !Number.isFinite(Number(wanted.value)) || Number.isNaN(rate)) {
      set(said, "a number is needed");
      return;
    }
    set(said, "…");
    set(said, await move({ name, value: Number(wanted.value), slew: rate }, token));
  });
  const body = make("article", "card", make("h3", "", name), value, about, make("div", "move", wanted, slew, button), said);
  body.dataset.parameter = name;
  return { body, value };
}

function field(label, hint) {
  const element = make("input", "");
  element.inputMode = "decimal";
  element.placeholder = hint;
  element.setAttribute("aria-label", label);
  return element;
}

// What became of it, in words.
async function move(wanted, token) {
  try {
    const answer = await fetch("/tune", {
      method: "POST",
      headers: { "X-Rig-Token": token, "X-Rig-Key": key, "Content-Type": "application/json" },
      body: JSON.stringify(wanted),
      signal: AbortSignal.timeout(GIVEN_UP),
    });
    if (answer.status === 403) return "not taken: open the address that ppy rig watch shows in its terminal";
    return (await answer.json()).error ?? "taken";
  } catch {
    return "no answer: nobody knows whether it was taken";
  }
}
