"""Claims: the yardstick of hidden effects hides nothing at strength zero and no form of the
catalogue, and measures what is left in noise widths.

`studies/hidden` shares no code with effects.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmus.kit import curves as catalogue_curves
from fmus.kit.symbolic import list_laws
from orchestration.fmu.model import find_model, known_effects
from studies.clean.records import Case, draw
from studies.hidden import curves
from studies.hidden.records import HiddenCase, cases, draw_hidden, left, widths
from studies.hidden.variations import NAMES, OUTSIDE, USUAL, VARIATIONS
from studies.judging.study import LEAST
from studies.plants.change import NOTHING, in_a_row, ladder, of_time, play, remembered
from studies.plants.library import PLANTS, altered


@pytest.mark.parametrize("name", NAMES)
def test_a_plant_with_nothing_hidden_is_the_clean_one(name):
    case = Case(name, "PRBS", "Gaussian", 5)
    bare, clean = draw(case, plant=altered(name, NOTHING)), draw(case)
    for output, y in clean.clean.items():
        assert np.max(np.abs(bare.clean[output] - y)) < 1e-4 * np.ptp(y)


def _increments(change, signals, step=1e-3):
    """Return what a change adds in the course of a signal, by Euler's method."""
    memory, added = list(change.rest), []
    for x in signals:
        added.append(change.more(x, memory))
        rates = change.rates(x, memory)
        memory = [s + step * rate for s, rate in zip(memory, rates, strict=True)]
    return np.array(added)


@pytest.mark.parametrize("name", VARIATIONS)
def test_strength_zero_hides_nothing(name):
    """Of widths and times, which divide, the limit is looked at."""
    variation = VARIATIONS[name]
    slight = 0.03 if "lag" in variation.family else 1e-9
    none, some = (
        variation.drawn(np.random.default_rng(1), strength, 60.0) for strength in (slight, 1.0)
    )
    if some.delay:
        assert none.delay == pytest.approx(slight * some.delay)
        return
    if "lag" in variation.family:  # of a ramp it is late by its time
        course, step, share = some.rest[0] + np.arange(3000.0), none.finest, slight
    else:
        course = (some.rest[0] if some.rest else 0.0) + 10.0 * np.sin(np.arange(600) / 20.0)
        step, share = min(0.1, some.finest), 1e-6
    most = np.max(np.abs(_increments(some, course, step)))
    assert most > 1e-5
    assert np.max(np.abs(_increments(none, course, step))) <= 1.01 * share * most


def _left_of(wanted, shape, x):
    """Share of a curve that a shape of the catalogue cannot be, of any amount and width, beside a
    line.
    """
    form, best = catalogue_curves.SHAPES[shape].form, np.inf
    for width in np.geomspace(1e-3, 10.0, 81):
        column = np.array([form(one, width, 1.0) for one in x])
        basis = np.column_stack([np.ones_like(x), x, column])
        error = wanted - basis @ np.linalg.lstsq(basis, wanted, rcond=None)[0]
        best = min(best, float(np.std(error)))
    line = np.polyval(np.polyfit(x, wanted, 1), x)
    return best / float(np.std(wanted - line))


@pytest.mark.parametrize(
    ("curve", "shape"),
    [
        (curves.dry_arctan(1.0, 0.02), "sign"),
        (curves.dry_root(1.0, 0.02), "sign"),
        (curves.stribeck(1.0, 0.02), "sign"),
        (curves.power(1.0, 1.0, 1.75), "odd_quadratic"),
        (curves.power(1.0, 1.0, 2.2), "odd_quadratic"),
        (curves.tapering_drag(1.0, 1.0), "odd_quadratic"),
        (curves.one_way(1.0, 1.0), "asymmetric"),
        (curves.one_way_power(1.0, 1.0), "asymmetric"),
        (curves.hard_sinh(1.0, 1.0), "cubic"),
        (curves.hard_rational(1.0, 1.0), "cubic"),
        (curves.stop_rounded(1.0, 0.3, 0.1), "upper_stop"),
        (curves.stop_hertz(1.0, 0.3, 0.1), "upper_stop"),
        (curves.butler_volmer(1.0, 1.0, 0.2), "saturating"),
    ],
)
def test_shapes_are_not_the_catalogues(curve, shape):
    x = np.linspace(-1.0, 1.0, 401)
    assert _left_of(np.array([curve(one) for one in x]), shape, x) > 0.01


def test_what_arrives_is_not_as_the_catalogue_has_it():
    u = np.linspace(-3.0, 3.0, 601)
    for curve in (curves.zone_hyperbola(0.5), curves.zone_soft(0.5), curves.zone_uneven(0.5)):
        arrived = u + np.array([curve(one) for one in u])
        ways = [u - np.clip(u, -d, d) for d in np.linspace(0.0, 1.0, 101)]
        assert min(np.max(np.abs(arrived - way)) for way in ways) > 0.02
        assert np.all(np.diff(arrived) >= -1e-12)  # nothing goes back
    for curve in (
        curves.level_algebraic(1.0, 1.0, 4.0),
        curves.level_arctan(1.0, 1.0),
        curves.level_exponential(1.0, 1.0),
    ):
        arrived = u + np.array([curve(one) for one in u])
        ways = [u / np.sqrt(1.0 + c * u * u) for c in np.geomspace(0.1, 10.0, 201)]
        assert min(np.max(np.abs(arrived - way)) for way in ways) > 0.02
        assert np.all(np.diff(arrived) >= 0.0)


def test_memories_do_what_they_are_called():
    step = np.ones(20_000)
    late = _increments(in_a_row("", 1.0, 2.0, 2), step)  # 1 ms steps
    time = 1e-3 * np.arange(step.size)
    assert late == pytest.approx(-(1.0 + time) * np.exp(-time), abs=2e-3)
    spread = _increments(remembered("", 1.0, (1.0, 3.0)), step)
    assert spread == pytest.approx(1.0 - 0.5 * (np.exp(-time) + np.exp(-time / 3.0)), abs=2e-3)
    diffusing = _increments(ladder("", 1.0, 1.5), step)
    a = 3.0 * 3.0 / 1.5 * np.array([[-1.0, 1.0, 0.0], [1.0, -2.0, 1.0], [0.0, 1.0, -2.0]])
    values, vectors = np.linalg.eigh(a)
    drive = vectors.T @ np.array([3.0 / 1.5, 0.0, 0.0])
    exact = [float((vectors @ (drive * np.expm1(values * t) / values))[0]) for t in time[::1000]]
    assert diffusing[::1000] == pytest.approx(exact, abs=5e-3)
    assert diffusing[-1] == pytest.approx(1.0, abs=1e-3)
    there_and_back = np.r_[np.linspace(0.0, 2.0, 4000), np.linspace(2.0, -2.0, 8000)]
    gap = lambda e: max(e - 0.5, 0.0) + min(e + 0.5, 0.0)  # noqa: E731
    passed = there_and_back + _increments(play("", gap, 0.005), there_and_back)
    assert passed[3999] == pytest.approx(1.5, abs=0.01)
    assert passed[5900] == pytest.approx(1.5, abs=0.01)  # stays on the way back
    assert passed[-1] == pytest.approx(-1.5, abs=0.01)
    assert _increments(of_time("", lambda x, t: t), step)[-1] == pytest.approx(20.0, rel=1e-3)


def test_right_answers_exist():
    """An effect by name, a constant of a law, or a law over or remembering an input or a state."""
    names = {}
    for name in NAMES:
        cls = find_model(PLANTS[name].model).cls
        effects = known_effects(cls, inputs=True)
        names[name] = {*effects} | {effect.term.family for effect in effects.values()}
        layout = cls.layout
        names[name] |= {f"{law.name}()" for law in list_laws(cls)}
        names[name] |= {
            f"{law.name} {word} {v.name}"
            for law in list_laws(cls)
            for word in ("over", "remembering")
            for v in (*layout.inputs, *layout.states)
        }
    for variation in VARIATIONS.values():
        assert variation.right <= names[variation.plant], variation
        assert bool(variation.right) == (variation.family != OUTSIDE)


def test_every_family_has_shapes_and_cases_repeat():
    drawn = cases(300, 3)
    assert drawn == cases(300, 3)
    assert {case.plant for case in drawn} == {*USUAL}
    assert {case.strength for case in drawn} == {1.0, 0.3}
    assert {(c.plant, c.variation.family) for c in drawn} == {
        (v.plant, v.family) for v in VARIATIONS.values() if v.plant in USUAL
    }
    cell = next(case for case in drawn if case.plant == "Cell" and case.timing == "usual")
    first, again = draw_hidden(cell), draw_hidden(cell)
    assert all(np.array_equal(first.outputs[o], again.outputs[o]) for o in first.outputs)


def test_what_is_left_is_counted_in_noise_widths():
    """A saturation that a square wave meets at one level each way is a gain; one that a ramp meets
    is none.
    """
    name = "Cell, resistance, exponent"
    square, ramp = (
        HiddenCase("Cell", stimulus, "Gaussian", 5, hidden=name)
        for stimulus in ("PRBS", "triangle")
    )
    assert left(draw_hidden(square)) < LEAST < left(draw_hidden(ramp))
    drawn = draw_hidden(ramp)
    slight = draw_hidden(replace(ramp, strength=0.3))
    volts = [left(one) * one.deviation["voltage"] for one in (slight, drawn)]
    assert volts[0] == pytest.approx(0.3 * volts[1], rel=0.05)
    off = {o: y + 2.0 * drawn.deviation[o] for o, y in drawn.clean.items()}
    assert widths(drawn, off) == pytest.approx(dict.fromkeys(off, 2.0))


def test_sensors_start_from_what_they_read_before_anything_happened():
    """Of a record that starts at rest the first sample is the open-circuit voltage, whatever the
    current.
    """
    lagging = next(
        n for n, v in VARIATIONS.items() if (v.plant, v.family) == ("Cell", "sensor lag")
    )
    drawn = draw_hidden(HiddenCase("Cell", "square", "Gaussian", 5, hidden=lagging))
    assert drawn.clean["voltage"][0] == pytest.approx(drawn.truth["ocv"])
    warm = next(
        n for n, v in VARIATIONS.items() if (v.plant, v.family) == ("ThermalNodes", "sensor lag")
    )
    drawn = draw_hidden(HiddenCase("ThermalNodes", "square", "Gaussian", 5, hidden=warm))
    assert {y[0] for y in drawn.clean.values()} == {293.0}
