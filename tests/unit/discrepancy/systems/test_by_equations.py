"""A member in its loop by its equations: which are known, and what of a record is looked at."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmus import component, effects
from fmus.kit import stack
from orchestration.discrepancy.systems.by_equations import diagnose_loop, equations_of
from orchestration.discrepancy.systems.cut import isolated_members
from orchestration.system import Member, Port, library
from tests.support.hosts import build_one_state_fmu


def test_equations_are_known_of_components_and_what_was_made_of_them(tmp_path):
    bench = component("voice_coil_dma")
    assert equations_of(Member.of("bench", bench)) is bench
    sticking = stack(bench, effects("voice_coil_dma")["coulomb_friction"])
    restored = equations_of(Member.of("bench", sticking))
    assert restored is not None
    assert "coulomb_force" in restored.layout.parameter_index
    assert equations_of(Member("other", build_one_state_fmu(tmp_path))) is None


def test_a_loop_with_a_member_of_others_is_left_to_their_fmus(tmp_path):
    system = library.system("dma_bench")
    time = 0.01 * np.arange(200)
    ports = {Port("bench", "position"): time, Port("bench", "tension"): time}
    bench, actuator = isolated_members(system, ports, {Port("actuator", "current"): 0.0})
    other = replace(actuator, member=Member("actuator", build_one_state_fmu(tmp_path)))
    assert diagnose_loop(bench, [other], system.connections, time) is None


@pytest.mark.parametrize(("rate", "seconds"), [(100.0, 10.0), (10.0, 100.0), (1000.0, 10.0)])
def test_so_much_of_a_long_record_is_looked_at(rate, seconds, monkeypatch):
    """Seen by what is given to the diagnosis: 10 s, or 1000 samples, less the first twentieth."""
    seen = {}

    def diagnose(cls, data, *_, **__):
        seen["data"] = data
        raise KeyboardInterrupt

    module = "orchestration.discrepancy.systems.by_equations"
    monkeypatch.setattr(f"{module}.diagnose", diagnose)
    monkeypatch.setattr(f"{module}.estimate_shift", lambda *_: 0.0)
    system = library.system("dma_bench")
    time = np.arange(round(1.2 * seconds * rate)) / rate
    steps = np.where(time % 2.0 < 1.0, 1.0, 2.0)
    ports = {
        Port("bench", "force_reference"): steps,
        Port("actuator", "current"): steps,
        Port("bench", "position"): steps,
        Port("actuator", "tension"): steps,
    }
    bench, actuator = isolated_members(system, ports, {})
    with pytest.raises(KeyboardInterrupt):
        diagnose_loop(bench, [actuator], system.connections, time)
    data = seen["data"]
    assert data.time[-1] == pytest.approx(seconds, abs=2.0 / rate)
    assert set(data.measured) == {"position", "actuator_tension"}
    first = np.flatnonzero(np.isfinite(data.measured["position"]))[0]
    assert data.time[first] == pytest.approx(0.05 * seconds, abs=2.0 / rate)
