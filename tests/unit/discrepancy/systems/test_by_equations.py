"""A member in its loop by its equations: which are known, and what of a record is looked at."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fmus import component, effects
from fmus.kit import Component, Discrete, Output, Parameter, State, stack
from orchestration.discrepancy.systems.by_equations import (
    LoopDiagnosis,
    diagnose_loop,
    equations_of,
    program_constants,
)
from orchestration.discrepancy.systems.cut import isolated_members
from orchestration.identify.fitting import Problem
from orchestration.system import Member, Port, library
from tests.support.archive import edited, of_other_laws
from tests.support.hosts import build_one_state_fmu

MODULE = "orchestration.discrepancy.systems.by_equations"


def test_equations_are_known_of_components_and_what_was_made_of_them(tmp_path):
    bench = component("voice_coil_dma")
    assert equations_of(Member.of("bench", bench)) is bench
    sticking = stack(bench, effects("voice_coil_dma")["coulomb_friction"])
    restored = equations_of(Member.of("bench", sticking))
    assert restored is not None
    assert "coulomb_force" in restored.layout.parameter_index
    assert equations_of(Member("other", build_one_state_fmu(tmp_path))) is None


def test_equations_of_a_file_are_known_where_its_laws_are_those_of_today(tmp_path):
    made = Member.of("bench", component("voice_coil_dma")).fmu
    assert equations_of(Member("bench", made)) is not None
    old = edited(made, tmp_path / "old.fmu", of_other_laws)
    assert equations_of(Member("bench", old)) is None


def test_a_loop_with_a_member_of_others_is_left_to_their_fmus(tmp_path):
    system = library.system("dma_bench")
    time = 0.01 * np.arange(200)
    ports = {Port("bench", "position"): time, Port("bench", "tension"): time}
    bench, actuator = isolated_members(system, ports, {Port("actuator", "current"): 0.0})
    other = replace(actuator, member=Member("actuator", build_one_state_fmu(tmp_path)))
    assert diagnose_loop(bench, [other], system.connections, time) is None


def loop_of_steps(rate: float, seconds: float) -> LoopDiagnosis | None:
    """Diagnose the bench with its actuator on a record of steps that no bench made."""
    system = library.system("dma_bench")
    time = np.arange(round(seconds * rate)) / rate
    steps = np.where(time % 2.0 < 1.0, 1.0, 2.0)
    ports = {
        Port("bench", "force_reference"): steps,
        Port("actuator", "current"): steps,
        Port("bench", "position"): steps,
        Port("actuator", "tension"): steps,
    }
    bench, actuator = isolated_members(system, ports, {})
    return diagnose_loop(bench, [actuator], system.connections, time)


@pytest.mark.parametrize(("rate", "seconds"), [(100.0, 10.0), (10.0, 100.0), (1000.0, 10.0)])
def test_so_much_of_a_long_record_is_looked_at(rate, seconds, monkeypatch):
    """Seen by what is given to the diagnosis: 10 s, or 1000 samples, less the first twentieth."""
    seen = {}

    def diagnose(cls, data, *_, held, **__):
        seen["data"] = data
        seen["held"] = held
        raise KeyboardInterrupt

    monkeypatch.setattr(f"{MODULE}.diagnose", diagnose)
    monkeypatch.setattr(f"{MODULE}.estimate_shift", lambda *_: 0.0)
    with pytest.raises(KeyboardInterrupt):
        loop_of_steps(rate, 1.2 * seconds)
    data = seen["data"]
    assert data.time[-1] == pytest.approx(seconds, abs=2.0 / rate)
    assert set(data.measured) == {"position", "actuator_tension"}
    first = np.flatnonzero(np.isfinite(data.measured["position"]))[0]
    assert data.time[first] == pytest.approx(0.05 * seconds, abs=2.0 / rate)
    assert {"error_gain", "previous_error_gain"} <= set(seen["held"])
    assert not {"R", "K", "m", "b_vc", "actuator_R1"} & set(seen["held"])


def test_all_that_was_looked_at_is_simulated_where_the_final_fit_failed(monkeypatch):
    """The final model then is that of the first part of the record."""

    def diagnose(cls, data, *_, **__):
        first = len(data.time) // 2
        inputs = {name: values[:first] for name, values in data.inputs.items()}
        measured = {name: values[:first] for name, values in data.measured.items()}
        problem = Problem(cls, data.time[:first], inputs, measured, [], {})
        final = SimpleNamespace(problem=problem, fit=SimpleNamespace(values={"m": 0.06}))
        return SimpleNamespace(final=final)

    monkeypatch.setattr(f"{MODULE}.diagnose", diagnose)
    monkeypatch.setattr(f"{MODULE}.estimate_shift", lambda *_: 0.0)
    loop = loop_of_steps(100.0, 4.0)
    assert loop is not None
    for simulated in (loop.before, loop.after):
        assert {y.shape for y in simulated.values()} == {(400,)}
    assert not np.allclose(loop.before["position"], loop.after["position"])


class SampledHeater(Component):
    """A heater that is switched by a program: ``dT/dt = power u - loss T``."""

    name = "sampled_heater"
    power = Parameter(2.0, "1/s")
    loss = Parameter(0.5, "1/s")
    gain = Parameter(3.0, "1")
    share = Parameter(0.5, "1", doc="of a program that corrects the sensor, which has it too")
    temperature = State("1", rate="warming")
    command = Discrete("1", update="next_command", period=0.1)

    def warming(self) -> Any:
        return self.power * self.command - self.loss * self.temperature

    def next_command(self) -> Any:
        return self.gain * (1.0 - self.share * self.temperature)

    @Output("1")
    def sensed(self) -> Any:
        return self.share * self.temperature

    @Output("1")
    def shown(self) -> Any:
        return 2.0 * self.command


@pytest.mark.parametrize(
    ("measured", "constants"), [(["sensed"], ["gain"]), (["sensed", "shown"], [])]
)
def test_constants_of_a_program_are_known_unless_what_it_commands_is_measured(measured, constants):
    assert program_constants(SampledHeater, measured) == constants
