"""Records of drawn models, simulated with NumPy and damaged as measured ones are, as CSV files."""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.support.fuzzed_models import FuzzedModel, plain_class

Values = NDArray[np.float64]

_SUBSTEPS = 4  # of the simulation, in a sample
_LARGEST = 1e12  # beyond which a simulation that runs away is cut off
OTHER_UNITS = {"m": ("mm", 1e3), "K": ("mK", 1e3), "A": ("mA", 1e3), "V": ("mV", 1e3)}
DAMAGES = (
    "noise free",
    "much noise",
    "nothing but noise",
    "short",
    "very short",
    "input missing",
    "output missing",
    "holes",
    "gap",
    "clipped",
    "spikes",
    "quantised",
    "constant output",
    "huge",
    "tiny",
    "late clock",
    "uneven clock",
    "two runs",
    "exchanged",
    "other sign",
    "other unit",
    "no unit",
    "all holes",
    "offset",
    "stuck",
    "ends in holes",
    "twice the same sample",
)


@dataclass(frozen=True)
class FuzzedRecord:
    """A record.

    Attributes
    ----------
    units : dict of str to str
        Of each column, by name.
    columns : dict of str to ndarray
        By name, the time first.
    """

    units: dict[str, str]
    columns: dict[str, Values]

    def text(self) -> str:
        """Return the record as a CSV file."""
        header = ",".join(f"{n} [{self.units[n]}]" if self.units[n] else n for n in self.columns)
        rows = np.column_stack(list(self.columns.values()))
        lines = [",".join("" if np.isnan(v) else f"{v:.9g}" for v in row) for row in rows]
        return "\n".join([header, *lines]) + "\n"


def stimulus(draw: random.Random, time: Values) -> Values:
    """Draw the course of an input, of order one."""
    rng = np.random.default_rng(draw.getrandbits(32))
    n, span = time.size, time[-1] - time[0]
    kind = draw.choice(
        ("multisine", "steps", "sine", "ramp", "walk", "constant", "zero", "pulse", "noise")
    )
    if kind == "multisine":
        phases = rng.uniform(0, 2 * np.pi, 6)
        return np.sum(
            [np.sin(2 * np.pi * 3 * 1.7**k * time / span + p) for k, p in enumerate(phases)],
            axis=0,
        )
    if kind == "steps":
        return np.repeat(rng.normal(size=n), max(2, n // draw.randint(4, 40)))[:n]
    if kind == "sine":
        return np.sin(2 * np.pi * draw.uniform(0.5, 30.0) * time / span)
    if kind == "ramp":
        return draw.choice((-1.0, 1.0)) * (time - time[0]) / span
    if kind == "walk":
        return np.cumsum(rng.normal(size=n)) / np.sqrt(n)
    if kind == "pulse":
        return (np.arange(n) == n // 3).astype(float)
    if kind == "noise":
        return rng.normal(size=n)
    return np.full(n, 1.0 if kind == "constant" else 0.0)


def simulate(
    model: FuzzedModel, time: Values, inputs: dict[str, Values], values: dict[str, float]
) -> dict[str, Values]:
    """Simulate a model by Euler's rule with given parameters and starts; outputs by name."""
    one: Any = plain_class(model)()
    discretes = model.of_kind("Discrete")
    states = model.of_kind("State")
    one.time = float(time[0])
    for v in model.variables:
        setattr(one, v.name, np.float64(values.get(v.name, v.value)))
    kept: dict[str, list[float]] = {name: [] for name in model.measured}
    outputs = {law.name for law in model.laws if law.kind == "output"}
    due = {d.name: float(time[0]) for d in discretes}
    with np.errstate(all="ignore"):
        for k, now in enumerate(time):
            one.time = float(now)
            for name, course in inputs.items():
                setattr(one, name, course[k])
            for d in discretes:
                if now >= due[d.name]:
                    period = d.about["period"]
                    due[d.name] += getattr(one, period) if isinstance(period, str) else period
                    setattr(one, d.name, _bounded(getattr(one, d.about["update"])()))
            for name, course_so_far in kept.items():
                value = getattr(one, name)
                course_so_far.append(_bounded(value() if name in outputs else value))
            step = (time[k + 1] - now if k + 1 < time.size else 0.0) / _SUBSTEPS
            for _ in range(_SUBSTEPS if states and step else 0):
                rates = [getattr(one, s.about["rate"])() for s in states]
                for s, rate in zip(states, rates, strict=True):
                    setattr(one, s.name, _bounded(getattr(one, s.name) + step * rate))
    return {name: np.array(course) for name, course in kept.items()}


def _bounded(value: Any) -> np.float64:
    number = float(value)
    return np.float64(min(max(number, -_LARGEST), _LARGEST) if number == number else 0.0)


def draw_record(draw: random.Random, model: FuzzedModel, damages: tuple[str, ...]) -> FuzzedRecord:
    """Draw a record of a model: stimuli, parameters that differ, and damages."""
    rng = np.random.default_rng(draw.getrandbits(32))
    n = draw.randint(230, 350)
    n = draw.randint(25, 229) if "short" in damages else n
    n = draw.randint(1, 12) if "very short" in damages else n
    time = model.step * np.arange(n)
    if n < 3:
        time = model.step * np.arange(3)
    inputs = {
        v.name: v.nominal * stimulus(draw, time) + draw.choice((0.0, 0.0, v.nominal))
        for v in model.of_kind("Input")
    }
    values = {
        v.name: v.value * draw.choice((1.0, 1.0, 1.0, draw.uniform(0.5, 2.0)))
        for v in model.of_kind("Parameter")
    }
    values |= {
        v.name: v.value + v.nominal * draw.gauss(0.0, 1.0)
        for v in model.of_kind("State")
        if draw.random() < 0.3
    }
    outputs = simulate(model, time, inputs, values)
    noise = 0.0 if "noise free" in damages else 0.5 if "much noise" in damages else 0.01
    for name, y in outputs.items():
        spread = float(np.std(y)) or float(np.abs(y).max()) or 1.0
        if "nothing but noise" in damages:
            y = np.zeros(time.size)
            spread = 100.0
        wrong = draw.choice((0.0, 0.1, 1.0)) * spread * np.tanh((y - y.mean()) / spread) ** 2
        outputs[name] = y + wrong + noise * spread * rng.normal(size=time.size)
    columns = {"time": time, **inputs, **outputs}
    units = {"time": "s"} | {v.name: v.unit for v in model.of_kind("Input")} | model.measured
    record = FuzzedRecord(units, {name: column[:n] for name, column in columns.items()})
    for damage in damages:
        record = _damaged(record, damage, draw, list(inputs), list(outputs))
    return record


def _damaged(
    record: FuzzedRecord, damage: str, draw: random.Random, inputs: list[str], outputs: list[str]
) -> FuzzedRecord:
    """Return a record with one damage."""
    columns = {name: column.copy() for name, column in record.columns.items()}
    units = dict(record.units)
    names = [name for name in columns if name != "time"]
    present = [name for name in outputs if name in columns]
    n = columns["time"].size
    if not names or not present:
        return record
    some, y = draw.choice(names), draw.choice(present)
    known = columns[y][np.isfinite(columns[y])]
    spread = (float(np.std(known)) if known.size else 0.0) or 1.0
    at, width = draw.randrange(n), max(1, draw.randrange(1 + n // 4))
    if damage in ("input missing", "output missing"):
        pool = inputs if damage == "input missing" else present
        gone = draw.choice(pool) if pool else ""
        columns.pop(gone, None)
    elif damage == "holes":
        columns[some][at : at + width] = np.nan
    elif damage == "gap":
        inside = np.arange(n)
        keep = (inside < at) | (inside >= at + width)
        columns = {name: column[keep] for name, column in columns.items()}
    elif damage == "clipped":
        limit = np.quantile(np.abs(known), 0.6) if known.size else 1.0
        columns[y] = np.clip(columns[y], -limit, limit)
    elif damage == "spikes":
        columns[y][draw.sample(range(n), min(n, 4))] += 30.0 * spread
    elif damage == "quantised":
        size = spread / draw.choice((1.0, 10.0))
        columns[some] = np.round(columns[some] / size) * size
    elif damage == "constant output":
        columns[y][:] = draw.choice((0.0, 3.0))
    elif damage in ("huge", "tiny", "other sign"):
        columns[some] *= {"huge": 1e9, "tiny": 1e-9, "other sign": -1.0}[damage]
    elif damage == "late clock":
        columns["time"] += draw.choice((1e5, 1.7e9)) * columns["time"][-1] / n
    elif damage == "uneven clock":
        steps = np.array([draw.uniform(0.2, 1.8) for _ in range(n)])
        columns["time"] = columns["time"][-1] * np.cumsum(steps) / n
    elif damage == "two runs":
        columns["time"][n // 2 :] -= columns["time"][n // 2]
    elif damage == "exchanged" and len(names) > 1:
        other = draw.choice([name for name in names if name != some])
        columns[some], columns[other] = columns[other], columns[some]
    elif damage == "other unit" and units[some] in OTHER_UNITS:
        units[some], factor = OTHER_UNITS[units[some]]
        columns[some] *= factor
    elif damage == "no unit":
        units[some] = ""
    elif damage == "all holes":
        columns[some][:] = np.nan
    elif damage == "offset":
        columns[some] += 1e3 * spread
    elif damage == "stuck":
        columns[some][at:] = columns[some][at]
    elif damage == "ends in holes":
        columns[some][-width:] = np.nan
    elif damage == "twice the same sample":
        columns = {name: np.insert(column, at, column[at]) for name, column in columns.items()}
    return FuzzedRecord(units, columns)
