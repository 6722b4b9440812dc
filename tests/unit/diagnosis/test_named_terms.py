"""Claims: a named term runs its effect, with exact derivatives by its parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmus.kit import Effect, Parameter, tanh
from fmus.kit import Term as EffectTerm
from orchestration.diagnosis import LawModel, Shape, Term
from orchestration.diagnosis.runs import Setting
from orchestration.diagnosis.terms import Memory, NamedTerm, Released
from orchestration.identify.fitting import Scale
from tests.support.diagnosed_mass import Mass, nominal, pushed
from tests.support.diagnosed_tank import AREA, DRAIN, START, drawn, tank

SILTING = NamedTerm(
    "drained",
    "height",
    Shape.LINEAR,
    constants=(3.0,),
    effect="silting",
    family="silt",
    released=(
        Released("silt", "m^2/s", Scale(False, 0.2), 0.0, 10.0),
        Released("silt_time", "s", Scale(True, 1.0), 0.01, 1e4),
    ),
)
LAG = Term("drained", "inflow", Shape.LINEAR, Memory.LAG, (2.0,), size=0.1)
VALUES = np.array([1.5, np.log(2.0)])  # 0.3 m^2/s, 2 s
TRUE = {"silt": 0.3, "time": 2.0}


def setting(*terms: Term, values: np.ndarray = VALUES) -> Setting:
    parameters = np.array([AREA, DRAIN, START])
    return Setting(parameters, np.array([0, 1]), terms, values, 4)


def test_a_run_is_that_of_the_effect() -> None:
    record = drawn(**TRUE)
    course = tank().run(record, setting(SILTING), np.array([START]))
    assert course is not None
    np.testing.assert_allclose(course.outputs, record.outputs, atol=2e-6)


@pytest.mark.parametrize("measured", [[True, True], [False, True]])
def test_derivatives_are_those_of_scipys_runs(measured: list[bool]) -> None:
    """Of the outputs that are measured."""
    record = drawn(**TRUE)
    seen = replace(record, outputs=np.where(measured, record.outputs, np.nan))
    course = tank().run(seen, setting(SILTING), np.array([START]), sensitive=True)
    assert course is not None
    assert course.slopes.shape == (160, sum(measured), 5)
    assert np.isfinite(course.outputs).all()
    h = 1e-4
    moves = [{"area": (AREA, h)}, {"k": (DRAIN, h)}, {"silt": (0.3, 0.2 * h)}]
    moves += [{"time": (2.0, 2.0 * h)}, {"start": (START, h)}]
    for column, move in enumerate(moves):
        ((name, (value, step)),) = move.items()
        above, below = (drawn(**TRUE | {name: value + sign * step}).outputs for sign in (1.0, -1.0))
        expected = (above - below) / (2.0 * h)
        np.testing.assert_allclose(course.slopes[:, :, column], expected[:, measured], atol=3e-5)


def test_values_stand_in_the_order_of_the_terms() -> None:
    record = drawn(60)
    own, named = np.array([0.8, np.log(2.0)]), VALUES
    one = tank().run(
        record, setting(LAG, SILTING, values=np.r_[own, named]), [START], sensitive=True
    )
    other = tank().run(
        record, setting(SILTING, LAG, values=np.r_[named, own]), [START], sensitive=True
    )
    assert one is not None
    assert other is not None
    np.testing.assert_array_equal(one.outputs, other.outputs)
    np.testing.assert_array_equal(one.slopes[:, :, [0, 1, 4, 5, 2, 3, 6]], other.slopes)
    lagged = one.states[:, 1]
    assert np.ptp(lagged) > 0.1, "the memory of the law stands before the states of the effect"
    assert lagged[0] == record.inputs[0, 0]
    assert one.states[0, 2] == 0.25


def test_a_linearisation_has_the_columns_of_the_model() -> None:
    record = drawn(40)
    given = setting(SILTING)
    course = tank().run(record, given, [START])
    assert course is not None
    part = tank().linearise(record, given, course)
    laws = tank().laws
    assert part.rates.shape == (40, 2, 6)
    # height: d/d area, k, silt, time, height, silted; then the state of the effect
    height, silted = course.states.T
    flow = DRAIN * height + 0.3 * silted
    by_area = -(record.inputs[:, 0] - flow) / AREA**2
    np.testing.assert_allclose(part.rates[:, 0, 0], by_area, rtol=1e-9)
    np.testing.assert_allclose(part.rates[:, 0, 2], -0.2 * silted / AREA, rtol=1e-9)
    np.testing.assert_allclose(part.rates[:, 0, 4:], [[-DRAIN / AREA, -0.3 / AREA]] * 40)
    np.testing.assert_allclose(part.rates[:, 1, 4:], [[0.5, -0.5]] * 40)
    by_law = part.rates_by_laws[:, :, laws.index("drained")]
    np.testing.assert_allclose(by_law, [[-1.0 / AREA, 0.0]] * 40)
    np.testing.assert_allclose(part.laws[:, laws.index("drained")], flow)


def test_beyond_its_range_a_parameter_stays_at_the_end_and_has_no_slope() -> None:
    record = drawn(40)
    below = setting(SILTING, values=np.array([-2.0, 0.0]))
    course = tank().run(record, below, [START], sensitive=True)
    assert course is not None
    np.testing.assert_allclose(course.outputs, record.outputs, atol=2e-6)
    assert not course.slopes[:, :, 2].any()


def test_a_fast_effect_has_shorter_steps() -> None:
    """The classical method is unstable from 2.8 time constants on; a sample is 12.5 of these."""
    fast = {"silt": 0.3, "time": 0.02}
    record = drawn(**fast)
    given = replace(setting(SILTING, values=np.array([1.5, np.log(0.02)])), substeps=1)
    course = tank().run(record, given, np.array([START]))
    assert course is not None
    np.testing.assert_allclose(course.outputs, record.outputs, atol=1e-3)


def test_an_effect_that_is_faster_than_any_record_shows_has_twelve_steps_in_a_sample() -> None:
    record = drawn(40)
    quick = replace(setting(SILTING, values=np.array([1.5, np.log(1e-4)])), substeps=1)
    stacked = tank().stacked((SILTING.effect,))
    plain = stacked._setting(record, quick, np.array([START]))
    assert plain is not None
    assert plain.substeps == 12
    slower = stacked._setting(record, replace(quick, substeps=20), np.array([START]))
    assert slower is not None
    assert slower.substeps == 20, "which the model asks for itself"


class Braked(Effect):
    """Dry friction of a mass, which is steep within a tenth of a millimetre a second."""

    id = "braked"
    neutral = "brake"
    term = EffectTerm("friction", "v", "F tanh(v / w)", "friction over v")
    brake = Parameter(0.0, "N", min=0.0, max=100.0, nominal=1.0, doc="force")
    brake_velocity = Parameter(1e-4, "m/s", min=1e-9, max=1.0, nominal=1e-4, doc="width")

    def friction(self):
        """Of the slide, and dry."""
        return super().friction() + self.brake * tanh(self.v / self.brake_velocity)


def test_dry_friction_has_steps_as_short_as_it_is_steep() -> None:
    """The mass stands until the spring outweighs the brake: its slope at rest is 5000 1/s."""
    model = LawModel(Mass, {"braked": Braked})
    record = pushed(50, 0.005)
    held = replace(record, inputs=np.full((50, 1), 0.5))
    released = (
        Released("brake", "N", Scale(False, 1.0), 0.0, 100.0),
        Released("brake_velocity", "m/s", Scale(True, 1e-4), 1e-9, 1.0),
    )
    term = NamedTerm(
        "friction", "v", Shape.LINEAR, constants=(1e-4,), effect="braked", released=released
    )
    values = np.array([1.0, np.log(1e-4)])
    setting = Setting(nominal(), np.array([0]), (term,), values, substeps=1)
    course = model.run(held, setting, np.zeros(2))
    assert course is not None
    creep = 1e-4 * np.arctanh(0.5)  # at which the brake holds the force
    assert course.states[5:, 1] == pytest.approx(creep, rel=0.05)
