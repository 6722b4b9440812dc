"""Claims: what is drawn to be hidden shows in 45 s; a seed draws the same again; the noise is as
declared.
"""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from demonstrations.bench import Bench
from demonstrations.emulator.physics import RigParameters
from demonstrations.emulator.stepping.hidden import SHOWING, hidden_effect
from demonstrations.emulator.stepping.noise import Noise
from demonstrations.emulator.variations import CATALOGUE
from orchestration.experiment.waveforms import multilevel

TIME = np.arange(45 * 30) / 30


@pytest.mark.parametrize("name", SHOWING)
@pytest.mark.parametrize("seed", [1, 2])
def test_what_can_be_drawn_shows_in_45_seconds(name: str, seed: int) -> None:
    """At least 1.2 noise widths are left when all parameters are refitted: 1350 samples make that
    plain.
    """
    effect = hidden_effect(name, seed)
    current = multilevel(TIME, [-1.0, -0.5, 0.0, 0.6, 1.0], (0.5, 4.0), seed)
    force = multilevel(TIME, [0.4, 1.0, 1.8, 2.5], (1.5, 4.0), seed + 100)
    bench = Bench(RigParameters(), TIME, current, force, 0, ("voltage", "displacement"))
    physics = partial(CATALOGUE[effect.id].physics, **effect.parameters or {})  # type: ignore[arg-type]
    widths = bench.widths(bench.noise_free(physics))
    assert max(widths.values()) > 1.2, effect


def test_a_seed_draws_the_same_and_all_come_up() -> None:
    drawn = [hidden_effect("drawn", seed) for seed in range(100)]
    assert drawn == [hidden_effect("drawn", seed) for seed in range(100)]
    assert {effect.id for effect in drawn} == {name.partition(".")[0] for name in SHOWING}
    assert {effect.output for effect in drawn} == {"", "displacement"}
    assert {hidden_effect("drawn", seed, ("voltage",)).output for seed in range(100)} == {""}


def test_what_is_hidden_can_be_told() -> None:
    assert str(hidden_effect("none", 0)) == "nothing is hidden"
    assert str(hidden_effect("quadratic_strain", 3)).startswith(
        "quadratic_strain: cosine_charge = "
    )


@pytest.mark.parametrize(
    ("name", "sensed", "message"),
    [
        ("nonsense", ("voltage",), "there are none, drawn, double_layer"),
        ("sensor_lag.displacement", ("voltage",), "here it can be about voltage"),
        ("double_layer.voltage", ("voltage",), "here it can be about nothing"),
    ],
)
def test_what_cannot_be_hidden_is_told(name: str, sensed: tuple[str, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        hidden_effect(name, 0, sensed)


@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_noise_has_the_declared_spread_and_colour(colour: float) -> None:
    noise, count = Noise({"voltage": 2.0, "tension": 0.5}, 3, colour), 40_000
    series = np.empty((count, 2))
    for row in series:
        row[:] = list(noise.values.values())
        noise.sample()
    effective = count * (1 - colour) / (1 + colour)
    for values, deviation in zip(series.T, (2.0, 0.5), strict=True):
        # variance of the estimated variance of an AR(1) series (Bartlett)
        spread = np.sqrt(2 * (1 + colour**2) / (1 - colour**2) / count)
        assert abs(np.var(values) / deviation**2 - 1) < 4 * spread
        assert abs(np.mean(values)) < 4 * deviation / np.sqrt(effective)
        assert np.mean(values[1:] * values[:-1]) / deviation**2 == pytest.approx(colour, abs=0.05)
    same = Noise({"voltage": 2.0, "tension": 0.5}, 3, colour)
    assert list(same.values.values()) == series[0].tolist()
    with pytest.raises(ValueError, match="between -1 and 1"):
        Noise({}, 0, 1.0)
