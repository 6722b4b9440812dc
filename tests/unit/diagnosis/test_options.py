"""Claims: options restrict what is fitted and searched, and a wrong name is refused in one line."""

from __future__ import annotations

import signal
from time import process_time

import pytest

from fmus.kit import Parameter, UserError
from orchestration.diagnosis import LawModel, Options, Shape, Term
from orchestration.diagnosis.options import Deadline
from orchestration.diagnosis.terms import NamedTerm, SensorTerm
from orchestration.fmu.model import declared_model
from tests.support.oscillator_model import Oscillator

NAMES = ["mass", "damping", "stiffness"]


class Weighed(Oscillator):
    """An oscillator with a constant of nature."""

    gravity = Parameter(9.81, "m/s^2", fitted=False)


@pytest.mark.parametrize(
    ("options", "held"),
    [
        (Options(), set()),
        (Options(hold=["mass"]), {"mass"}),
        (Options(fit=["mass"]), {"damping", "stiffness"}),
        (Options(fit=["mass", "damping"], hold=["stiffness"]), {"stiffness"}),
    ],
)
def test_what_is_not_to_be_fitted_is_held(options, held):
    assert options.held(NAMES) == held


def test_an_input_may_be_held_for_an_experiment_and_is_no_parameter():
    options = Options(hold=["mass", "force"])
    assert options.held(NAMES, ["force"]) == {"mass"}
    with pytest.raises(UserError, match="no parameter named 'force'"):
        options.held(NAMES)
    with pytest.raises(UserError, match="no parameter named 'force'"):
        Options(fit=["force"]).held(NAMES, ["force"])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (Options(hold=["mas"]), "hold.*no parameter named 'mas' .did you mean mass"),
        (Options(fit=["mas"]), "fit.*no parameter named 'mas' .did you mean mass"),
        (Options(fit=["mass"], hold=["mass"]), "fit.*mass is held by hold"),
    ],
)
def test_a_parameter_that_is_unknown_or_both_is_refused(options, message):
    with pytest.raises(UserError, match=message):
        options.held(NAMES)


OWN = '''
from fmus.kit import Effect, Parameter


class Friction(Effect):
    """A constant force."""

    id = "push"
    neutral = "push"
    push = Parameter(0.0, "N", min=-10, max=10)

    def {law}(self):
        return {value}
'''


def test_an_effect_of_a_users_file_is_named_by_its_place(tmp_path):
    file = tmp_path / "own.py"
    file.write_text(OWN.format(law="friction", value="super().friction() + self.push"))
    assert set(Options(effects=[f"{file}:Friction"]).effects_of(Oscillator)) == {"push"}
    file.write_text(OWN.format(law="friction", value="super().friction() + self.mass"))
    with pytest.raises(UserError, match=r"own\.py, line 13.* kg"):
        Options(effects=[f"{file}:Friction"]).effects_of(Oscillator)
    file.write_text(OWN.format(law="leak", value="self.push"))
    with pytest.raises(UserError, match=r"own\.py:Friction.*nothing of oscillator.*leak"):
        Options(effects=[f"{file}:Friction"]).effects_of(Oscillator)
    with pytest.raises(UserError, match=r"nowhere\.py: cannot be read"):
        Options(effects=["nowhere.py:Friction"]).effects_of(Oscillator)


def test_effects_are_those_that_are_named_by_name_or_id():
    cls = declared_model("ppy_actuator").cls
    chosen = Options(effects=["diffusion", "slack"]).effects_of(cls)
    assert set(chosen) == {"diffusion", "slack", "slack(smooth)"}
    assert set(Options(effects=["slack(smooth)"]).effects_of(cls)) == {"slack(smooth)"}
    every = Options().effects_of(cls)
    assert len(every) > 10
    assert Options(effects=["families"]).effects_of(cls) == every
    assert Options(effects=[]).effects_of(Oscillator) == {}


def test_effects_that_fit_laws_by_their_units_and_faults_of_sensors_may_be_named():
    """Those of sensors may be causes in any case."""
    assert set(Options(effects=["input_lag(force)"]).effects_of(Oscillator)) == {"input_lag(force)"}
    assert Options(effects=["sensor_lag(position)"]).effects_of(Oscillator) == {}


def test_each_names_parameters_that_are_fitted_and_start_states_are_anyway():
    model = LawModel(Oscillator)
    chosen = Options(each=["damping", "velocity_start", "damping"])
    assert chosen.own_of_each(model) == ("damping",)
    for options, message in (
        (Options(each=["damp"]), "each.*no parameter named 'damp' .did you mean damping"),
        (Options(each=["mass"], hold=["mass"]), "each.*mass is not fitted, so it cannot differ"),
        (Options(each=["mass"], fit=["damping"]), "each.*mass is not fitted"),
    ):
        with pytest.raises(UserError, match=message):
            options.own_of_each(model)


def test_without_laws_only_effects_and_sensors_are_candidates():
    law = Term("friction", "velocity", Shape.DRY)
    effect = NamedTerm("friction", "velocity", Shape.LINEAR, effect="dry")
    sensor = SensorTerm("position", "", Shape.CONSTANT)
    assert [Options(laws=False).is_candidate(term) for term in (law, effect, sensor)] == [
        False,
        True,
        True,
    ]
    assert Options().is_candidate(law)


def test_parameters_alone_are_fitted_without_effects_and_laws():
    assert Options(effects=[], laws=False).recalibrates
    assert not Options(effects=[]).recalibrates
    assert not Options(effects=["diffusion"], laws=False).recalibrates


def test_an_unknown_effect_is_refused_with_one_that_is_alike():
    cls = declared_model("ppy_actuator").cls
    with pytest.raises(UserError, match=r"no effect named 'difusion'.*diffusion"):
        Options(effects=["difusion"]).effects_of(cls)


def test_a_deadline_is_of_processor_time():
    assert not Deadline(None).is_over()
    assert not Deadline(60.0).is_over()
    short = Deadline(0.02)
    assert short.was_met
    begun = process_time()
    while process_time() < begun + 0.03:
        pass
    assert short.is_over()
    assert not short.was_met
    unasked = Deadline(0.0)
    assert unasked.was_met


def test_ctrl_c_is_the_end_of_a_search_and_the_second_one_interrupts():
    deadline = Deadline(None)
    with deadline.ended_by_ctrl_c():
        signal.raise_signal(signal.SIGINT)
        assert deadline.is_over()
    with deadline.ended_by_ctrl_c(), pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
    assert (deadline.is_over(), deadline.interrupted, deadline.was_met) == (True, True, False)
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_what_is_declared_as_not_fitted_is_held_unless_its_fit_is_asked_for():
    model = LawModel(Weighed)
    assert Options().held_of(model) == {"gravity"}
    assert Options(hold=["damping"]).held_of(model) == {"damping", "gravity"}
    everything_else = {p.name for p in model.parameters} - {"gravity"}
    assert Options(fit=["gravity"]).held_of(model) == everything_else
