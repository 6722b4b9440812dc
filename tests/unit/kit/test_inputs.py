"""Claims: an effect of an input passes on what its formula says.

Oracle: equations of motion with that input, integrated by SciPy.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import UserError, stack
from fmus.kit.inputs import (
    asymmetric_dead_zone,
    backlash,
    dead_zone,
    input_delay,
    input_lag,
    input_offset,
    input_saturation,
)
from fmus.kit.record.compiled import CompiledModel
from tests.support.pushed_mass import (
    BASE,
    FORCE,
    INPUT_CASES,
    MASS,
    TIME,
    M,
    by_scipy,
    fed,
    follows,
    without,
)


@pytest.mark.parametrize("name", sorted(INPUT_CASES))
def test_an_input_arrives_as_its_formula_says(name):
    follows(*INPUT_CASES[name])


def test_effects_on_one_input_follow_one_another():
    """The first is next to the command: an offset before a dead zone, and behind it."""
    for effects, expected in (
        (
            (input_offset(MASS, "force"), dead_zone(MASS, "force")),
            lambda u: (u + 1.0) - np.clip(u + 1.0, -2.0, 2.0),
        ),
        (
            (dead_zone(MASS, "force"), input_offset(MASS, "force")),
            lambda u: u - np.clip(u, -2.0, 2.0) + 1.0,
        ),
    ):
        model = stack(MASS, *effects)(**BASE, force_input_offset=1.0, force_dead_zone=2.0)
        for force in (-5.0, -1.5, 0.5, 4.0):
            model.force = force
            assert model.rates()[1] == pytest.approx(expected(force) / M)


def test_a_delayed_input_drives_as_it_was_commanded_before():
    """Oracle: the mass driven by a square wave that is shifted in time, by SciPy."""
    dead_time = 0.34
    cls = stack(MASS, input_delay(MASS, "force"))
    model = CompiledModel(cls)
    late = model.run(TIME, {"force": FORCE}, BASE | {"force_delay": dead_time})
    late_force = FORCE[np.maximum(np.arange(len(TIME)) - 34, 0)]
    expected = by_scipy(fed(lambda u: u), 2, late_force)
    assert np.abs(without() - expected).max() > 0.1, "it shows"
    # a jump is a ramp over 20 ms about the instant, which moves the mass by less than half a
    # millimetre for a moment
    assert np.abs(late.signals["position"] - expected).max() < 5e-4
    plain, at_once = (one.run(TIME, {"force": FORCE}, BASE) for one in (CompiledModel(MASS), model))
    assert np.array_equal(plain.signals["position"], at_once.signals["position"])


def test_an_input_that_is_none_is_refused():
    with pytest.raises(UserError, match="mass_spring_damper: no real input named 'voltage'"):
        dead_zone(MASS, "voltage")


def arriving(effect, values, force, **more):
    model = stack(MASS, effect)(**values)
    model.force = force
    for name, value in more.items():
        setattr(model, name, value)
    return model.force


def test_sizes_are_what_arrives():
    zone = dead_zone(MASS, "force")
    (dead,) = (size.quantity(2.0) for size in zone.sizes)
    assert arriving(zone, {"force_dead_zone": 2.0}, 0.999 * dead) == 0.0
    assert arriving(zone, {"force_dead_zone": 2.0}, 1.001 * dead) > 0.0

    zone = asymmetric_dead_zone(MASS, "force")
    values = {"force_dead_zone_end": 2.0, "force_dead_zone_ratio": 1.5}
    upper, lower = zone.sizes
    assert arriving(zone, values, 0.999 * lower.quantity(2.0, 1.5)) == 0.0
    assert arriving(zone, values, 1.001 * lower.quantity(2.0, 1.5)) < 0.0
    assert arriving(zone, values, 1.001 * upper.quantity(2.0)) > 0.0

    level = input_saturation(MASS, "force")
    (most,) = (size.quantity(0.04) for size in level.sizes)
    assert arriving(level, {"force_saturation": 0.04}, 1e6) == pytest.approx(most)

    play = backlash(MASS, "force")
    (gap,) = (size.quantity(0.3) for size in play.sizes)
    ends = [
        force - arriving(play, {"force_play": 0.3}, force, force_passed_on=0.0)
        for force in (5.0, -5.0)
    ]
    assert gap == pytest.approx(ends[0] - ends[1])

    late = input_lag(MASS, "force")
    values = {"force_lagging_share": 0.4, "force_lag": 1.0}
    at_once = arriving(late, values, 1.0, force_behind=0.0)
    assert late.sizes[0].quantity(0.4) == pytest.approx(100.0 * (1.0 - at_once))
