"""Claims: terms have readable names, units of their law and signal, and intervals that hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmus.kit import Component, Input, Output
from fmus.kit.titles import titled
from fmus.kit.units import powers_of_names
from orchestration.diagnosis.extension import extended_component
from orchestration.diagnosis.term_names import (
    estimates,
    seen_title,
    sentence,
    shape_text,
    stems,
    term_parameters,
)
from orchestration.diagnosis.terms import Memory, NamedTerm, Released, Shape, Term
from orchestration.identify.fitting import Scale
from tests.support.fitted_terms import fitted
from tests.support.oscillator import DRY, diagnosis_with, oscillator_record
from tests.support.oscillator_model import Oscillator

LAG = Term("friction", "velocity", Shape.LINEAR, Memory.LAG, (0.5,), size=4.0, scale=2.0)


class Oven(Component):
    """An oven whose names are symbols, and one of whose laws has a title."""

    name = "oven_of_symbols"
    Ta = Input("K")
    Tl = Input("K")

    @titled("Losses to the room")
    def losses(self):
        """Losses."""
        return 0.1 * (self.Tl - self.Ta)

    @Output("W")
    def P(self):
        """Power."""
        return self.losses()


@pytest.mark.parametrize(
    ("signal", "factor", "said"),
    [
        ("Tl", "", "losses to the room over Tl"),
        ("Tl", "Ta", "losses to the room over Tl, in proportion to Ta"),
        ("Tl", "losses", "losses to the room times a function of Tl"),
        ("losses", "", "losses to the room over itself"),
    ],
)
def test_names_keep_their_case_and_a_cause_is_over_its_signal(signal, factor, said):
    assert sentence(Oven, Term("losses", signal, Shape.SQUARE, factor=factor)) == said


def test_names_are_made_of_law_and_signal():
    offset = Term("friction", "", Shape.CONSTANT)
    cube = replace(DRY, shape=Shape.CUBE)
    assert [*stems(Oscillator, [DRY, cube, LAG, offset])] == [
        "friction_of_velocity",
        "friction_of_velocity_no_2",
        "friction_of_velocity_lag",
        "friction_offset",
    ]


def test_a_model_that_was_extended_is_extended_again():
    """By the same law over the same signal, as a diagnosis of the extended model may find."""
    once = extended_component(fitted(Oscillator, [DRY], [[0.1, 0.0]]))
    terms = [DRY, replace(DRY, shape=Shape.CUBE)]
    assert [*stems(once, terms)] == ["friction_of_velocity_no_2", "friction_of_velocity_no_3"]
    twice = extended_component(fitted(once, terms, [[0.2, 0.0], [0.3]]))
    names = {p.name: p.start for p in twice.layout.parameters}
    assert names["friction_of_velocity"] == pytest.approx(0.1 * DRY.size)
    assert names["friction_of_velocity_no_2"] == pytest.approx(0.2 * DRY.size)


@pytest.mark.parametrize(
    ("term", "units"),
    [
        (DRY, ["N", "m/s"]),
        (replace(DRY, shape=Shape.LINEAR), ["N/(m/s)"]),
        (replace(DRY, shape=Shape.CUBE), ["N/(m/s)^3"]),
        (LAG, ["N/(m/s)", "s"]),
        (replace(LAG, memory=Memory.PLAY), ["N/(m/s)", "m/s"]),
        (replace(LAG, memory=Memory.TWO_LAGS, constants=(1.0, 2.0)), ["N/(m/s)", "s", "1"]),
        (replace(LAG, memory=Memory.RATE_LIMIT, constants=(1.0, 2.0)), ["N/(m/s)", "s", "m/s/s"]),
        (Term("friction", "force", Shape.SQUARE, Memory.THROUGHPUT), ["N/(N*s)^2"]),
        (Term("friction", "elongation", Shape.LINEAR, factor="friction"), ["1/m"]),
        (Term("friction", "velocity", Shape.CURVE, places=(-1.0, 0.0, 1.0)), ["N", "N", "N"]),
    ],
)
def test_units_are_those_of_law_and_signal(term, units):
    found = [one.unit for one in term_parameters(Oscillator, "a", term)]
    assert [*map(powers_of_names, found)] == [*map(powers_of_names, units)]


class Shaft(Component):
    """Inputs and outputs of a shaft, as of an FMU without equations."""

    name = "shaft"
    fed = frozenset({"torque_in_fmu"})
    torque = Input("N*m", title="torque")
    omega_simulated = Input("rad/s", title="simulated omega")
    level_simulated = Input("m", title="simulated level")

    @titled("torque")
    def torque_in_fmu(self):
        return self.torque

    @Output("rad/s", title="omega")
    def omega(self):
        return self.omega_simulated


@pytest.mark.parametrize(
    ("signal", "shape", "value", "said"),
    [
        ("omega", Shape.DRY, -1.0, "torque that opposes omega, of one size: dry friction"),
        ("omega", Shape.DRY, 1.0, "torque that goes with omega, of one size"),
        ("omega", Shape.LINEAR, -1.0, "torque that opposes omega, in proportion to it: viscous"),
        ("level", Shape.LINEAR, -1.0, "torque that opposes level, in proportion to it"),
        ("omega", Shape.DRY, None, "torque that depends on omega"),
        ("omega", Shape.CURVE, -1.0, "torque that depends on omega"),
    ],
)
def test_what_an_fmu_gets_is_told_in_words_of_its_ports(signal, shape, value, said):
    term = Term("torque_in_fmu", f"{signal}_simulated", shape)
    assert sentence(Shaft, term, value).removesuffix(" friction") == said.removesuffix(" friction")
    late = replace(term, memory=Memory.LAG)
    assert sentence(Shaft, late, value) == f"torque that depends on lagging {signal}"
    assert seen_title(Shaft, term) == signal
    assert seen_title(Shaft, replace(term, law="omega")) == f"simulated {signal}"


def test_a_port_in_proportion_to_itself_has_another_gain():
    gain = Term("torque_in_fmu", "torque", Shape.LINEAR)
    assert sentence(Shaft, gain, -0.1) == sentence(Shaft, gain) == "another gain of torque"
    curve = replace(gain, shape=Shape.CURVE)
    assert sentence(Shaft, curve, -0.1) == "torque that depends on torque"


def test_a_logarithm_of_an_effects_parameter_is_that_of_its_value():
    released = Released("drag_time", "s", Scale(True, 20.0), 0.1, 1e3)
    term = NamedTerm("friction", "velocity", Shape.LINEAR, effect="drag", released=(released,))
    (one,) = term_parameters(Oscillator, "drag", term)
    assert one.logarithmic
    assert one.factor * np.exp(np.log(15.0)) == pytest.approx(15.0)


def test_only_amounts_of_a_term_have_a_value_without_it(dry):
    """The width of a friction that is not there is none."""
    found = estimates(dry.final.fit, dry.terms)
    (stem,) = dry.terms
    assert found[stem].nominal == 0.0
    assert found[stem].to_dict()["nominal"] == 0.0
    width = found[f"{stem}_width"]
    assert width.value > 0.0
    assert np.isnan(width.nominal)
    assert width.to_dict()["nominal"] is None
    assert found["stiffness"].nominal == 20.0


def test_texts_say_signal_memory_and_middle():
    assert sentence(Oscillator, DRY) == "friction over velocity"
    assert sentence(Oscillator, LAG) == "friction over lagging velocity"
    assert shape_text(replace(DRY, middle=2.0)) == "a tanh((x - 2)/w)"
    above = replace(DRY, shape=Shape.ABOVE, middle=2.0)
    assert shape_text(above) == "a max((x - 2) - w, 0)"


@pytest.mark.slow
def test_intervals_hold_the_truth_as_often_as_they_say():
    held = 0
    for seed in range(20):
        diagnosis = diagnosis_with(oscillator_record(seed, dry=1.5, samples=300), (DRY,))
        fitted = diagnosis.found.fits[0].fit
        low, high = estimates(fitted, stems(Oscillator, fitted.terms))[
            "friction_of_velocity"
        ].interval
        held += low < 1.5 < high
    assert held >= 17
    assert np.isfinite(high)


def test_a_curve_is_as_sure_as_its_shape_and_not_as_its_level():
    """A constant in the friction shifts the level of a curve: added, it changes no interval."""
    curve = Term(
        "friction", "velocity", Shape.CURVE, size=2.0, scale=1.0, places=(-1.5, -0.1, 0.1, 1.5)
    )
    offset = Term("friction", "", Shape.CONSTANT, size=2.0)
    diagnosis = diagnosis_with(oscillator_record(1, dry=1.5), (curve,), (curve, offset))
    widths = []
    for judged in diagnosis.found.fits:
        found = estimates(judged.fit, stems(Oscillator, judged.fit.terms))
        ends = [found[f"friction_of_velocity_at_{k}"].interval for k in range(4)]
        widths.append([high - low for low, high in ends])
    assert widths[1] == pytest.approx(widths[0], rel=0.1)


def test_a_value_of_a_curve_where_no_record_was_is_not_determined():
    """The velocity stays within 3 m/s: what the curve has at 60 m/s and beyond is free."""
    curve = Term(
        "friction",
        "velocity",
        Shape.CURVE,
        size=2.0,
        scale=1.0,
        places=(-1.5, 0.0, 1.5, 60.0, 90.0),
    )
    diagnosis = diagnosis_with(oscillator_record(1, dry=1.5), (curve,), (curve,))
    fitted = diagnosis.found.fits[0].fit
    found = estimates(fitted, stems(Oscillator, fitted.terms))
    ends = [found[f"friction_of_velocity_at_{k}"].interval for k in range(5)]
    assert np.isfinite(ends).all(axis=1).tolist() == [True, True, True, True, False]


def test_intervals_do_not_hang_on_the_weights_of_the_search(dry):
    fitted = dry.final.fit
    weighed = replace(fitted, curvature=100.0 * fitted.curvature)
    assert estimates(weighed, dry.terms) == estimates(fitted, dry.terms)
