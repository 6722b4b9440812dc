"""Claims: every effect of the catalogue does in time what it does over a record."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from demonstrations.emulator.emulator import EmulatedRig
from demonstrations.emulator.physics import RigParameters
from demonstrations.emulator.stepping.bench import BenchPlant
from demonstrations.emulator.stepping.hidden import HiddenEffect, hidden_effect
from demonstrations.emulator.stepping.plants import ForceDriven
from demonstrations.emulator.stepping.rig import SteppedRig
from demonstrations.emulator.variations import CATALOGUE

P = RigParameters()
NAMES = [
    name + (f".{output}" if output else "")
    for name, variation in CATALOGUE.items()
    for output in variation.limits
]


@pytest.mark.parametrize("name", NAMES)
def test_an_effect_in_time_is_the_effect_over_a_record(name: str) -> None:
    """A record's row shows inputs of that row; in time it is shown when they are commanded, before
    they have passed.
    """
    effect = hidden_effect(name, 5)
    kind = CATALOGUE[effect.id].physics
    random, step, count = np.random.default_rng(1), 0.05, 400
    current = np.repeat(random.uniform(-1.3, 1.3, count // 16), 16)
    force = np.repeat(random.uniform(0.2, 3.0, count // 25), 25)
    rig = SteppedRig(ForceDriven(effect.physics(P)), ("voltage", "displacement"))
    found = []
    for amperes, newtons in zip(current, force, strict=True):
        rig.command({"current": amperes, "force": newtons})
        found.append(rig.true())
        rig.advance(step)
    record = EmulatedRig(P, hidden=partial(kind, **effect.parameters or {}))  # type: ignore[arg-type]
    record.run(step * np.arange(count), current, force)
    for output in ("voltage", "displacement"):
        exact = record.truth[output]
        values = np.array([row[output] for row in found])
        assert np.abs(values - exact).max() < 1e-6 * np.abs(exact).max(), output


def test_a_late_sensor_on_the_bench_shows_what_was() -> None:
    late = HiddenEffect("transport_delay", "voltage", {"late_output": "voltage", "delay": 0.1})
    rigs = [
        SteppedRig(BenchPlant(effect.physics(P)), ("voltage",)) for effect in (HiddenEffect(), late)
    ]
    shown: list[list[float]] = [[], []]
    for k in range(100):
        for rig, values in zip(rigs, shown, strict=True):
            rig.command({"current": float(np.sin(k / 7)), "force_reference": 1.0})
            rig.advance(0.01)
            values.append(rig.true()["voltage"])
    # at the end of a step the inputs of that step are still held; ten steps later those of the next
    # one were, too
    plain, delayed = np.array(shown[0]), np.array(shown[1])
    resistance = P.R1 * P.R2 / (P.R1 + P.R2)
    jump = resistance * np.diff([np.sin(k / 7) for k in range(91)])
    np.testing.assert_allclose(delayed[10:], plain[:-10] + jump, atol=1e-9)


def test_the_past_is_kept_no_longer_than_it_is_needed() -> None:
    late = HiddenEffect("transport_delay", "voltage", {"late_output": "voltage", "delay": 0.1})
    rig = SteppedRig(ForceDriven(late.physics(P)), ("voltage",))
    rig.command({"current": 1.0, "force": 0.0})
    for _ in range(20_000):
        rig.advance(1e-3)
    assert len(rig._past._times) < 10_000
