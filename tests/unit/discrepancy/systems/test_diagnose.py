"""Which member of a system is wrong: records of closed loops, made without any FMU, are cut open
and judged.

A member with another parameter is named with it: actuator, galvanostat, estimator and foot. What is
written of it is documented.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from fmus import effects
from fmus.kit.errors import UserError
from orchestration.discrepancy.report.system import (
    describe_reasons,
    describe_source,
    system_diagnosis_summary,
)
from orchestration.discrepancy.systems.cut import ReasonCode
from orchestration.discrepancy.systems.diagnose import diagnose_system
from orchestration.discrepancy.systems.verdict import Effort, MemberVerdict
from orchestration.experiment.waveforms import multilevel
from orchestration.records import write_record
from orchestration.system import library as shipped
from orchestration.system import ssp
from tests.support.reference import documented, fields
from tests.support.system.closed_loop import NOISE, WATCH, measure, watched
from tests.support.system.lags import lags

BENCH = {
    "force_reference": "N",
    "current": "A",
    "actuator.tension": "N",
    "actuator.voltage": "V",
    "bench.position": "m",
    "bench.force_measured": "N",
}
FEET = ("an", "po", "do", "pl")
ALL_RIGHT = {"estimator": "consistent", "galvanostat": "consistent", "actuator": "consistent"}


def held_bench(folder, **hidden):
    """Bench over six seconds at 100 Hz."""
    system, every = shipped.system("dma_bench"), 10
    grid = 0.01 * np.arange(600)
    inputs = {
        "force_reference": np.repeat(multilevel(grid, [0.5, 1.0, 2.0, 3.0], (0.5, 2.0), 1), every),
        "current": np.repeat(multilevel(grid, [-1.0, -0.3, 0.5, 1.2], (0.5, 2.0), 2), every),
    }
    time = 0.001 * np.arange(600 * every)
    measure(folder / "record.csv", system, BENCH, time, inputs, every, **hidden)
    ssp.write(system, folder / "system.ssp")
    return diagnose_system(
        folder / "record.csv", folder / "system.ssp", effort=Effort(simulations=30, parameters=2)
    )


def diagnosed_lags(folder, gain=1.0, **taus):
    lags(folder, gain, **taus)
    return diagnose_system(folder / "record.csv", folder / "system.ssp")


def verdicts(diagnosis):
    return {m.name: m.verdict for m in diagnosis.members}


def sources(member):
    return {
        name: describe_source(given, name in member.linear) for name, given in member.inputs.items()
    }


@pytest.mark.slow
def test_a_record_of_the_system_itself_blames_nobody(tmp_path):
    diagnosis = watched(tmp_path)
    assert verdicts(diagnosis) == ALL_RIGHT
    assert diagnosis.verdict is MemberVerdict.CONSISTENT
    estimator = diagnosis.members[0]
    assert "voltage_limit does not move in this record" in describe_reasons(estimator)
    actuator = diagnosis.members[2]
    assert sources(actuator)["current"] == "galvanostat.current, held between samples"
    for output, unit in (("voltage", "V"), ("displacement", "m")):
        assert actuator.final[output].noise_std == pytest.approx(NOISE[unit], rel=0.1)
    text = json.dumps(system_diagnosis_summary(diagnosis), allow_nan=False)
    assert json.loads(text)["members"][2]["model"] == "ageing_actuator"
    assert json.loads(text)["members"][2]["reasons"][0]["code"] == "residual_is_noise"


@pytest.fixture(scope="module")
def saturating(tmp_path_factory):
    """An actuator whose strain saturates."""
    return watched(
        tmp_path_factory.mktemp("saturating"),
        hidden=effects("ppy_actuator")["strain_saturation"],
        values={"actuator.strain_saturation_coefficient": 0.3},
    )


@pytest.mark.slow
def test_the_member_with_another_structure_is_named(saturating):
    assert verdicts(saturating) == ALL_RIGHT | {"actuator": "wrong"}
    assert saturating.wrong == ["actuator"]
    actuator = saturating.members[2]
    assert not actuator.final["voltage"].wrong
    assert "displacement is off by" in describe_reasons(actuator)
    assert "whatever its parameters" in describe_reasons(actuator)


@pytest.mark.slow
def test_the_fields_documented_of_a_system_are_those_written(saturating):
    named = replace(saturating.members[0], causes=["one"], alternatives=["another"])
    shown = replace(saturating, members=[named, *saturating.members[1:]])
    written = json.loads(json.dumps(system_diagnosis_summary(shown), allow_nan=False))
    assert {path for path, _ in fields(written)} == set(documented(system=True))


@pytest.mark.slow
def test_a_member_with_another_parameter_is_recalibrated(tmp_path):
    diagnosis = watched(tmp_path, values={"actuator.R1": 1.4 * 0.43})
    assert verdicts(diagnosis) == ALL_RIGHT | {"actuator": "recalibrate"}
    changed = {n: c for n, c in diagnosis.members[2].parameters.items() if c.differs}
    assert list(changed) == ["R1"]
    assert changed["R1"].value == pytest.approx(1.4 * 0.43, rel=0.01)
    low, high = changed["R1"].interval
    assert low < 1.4 * 0.43 < high
    assert (
        describe_reasons(diagnosis.members[2])
        == f"R1 is {changed['R1'].value:.4g} ohm instead of 0.43 ({low:.4g} to {high:.4g})"
    )


def test_what_to_measure_is_told(tmp_path):
    few = {name: unit for name, unit in WATCH.items() if name != "galvanostat.current"}
    diagnosis = watched(tmp_path, few)
    reasons = {m.name: describe_reasons(m) for m in diagnosis.members}
    assert reasons["actuator"] == "current is not measured (measure galvanostat.current)"
    assert reasons["galvanostat"] == "none of its outputs is measured"
    assert set(verdicts(diagnosis).values()) == {"cannot be judged"}
    codes = {m.name: [reason.code for reason in m.reasons] for m in diagnosis.members}
    assert codes["actuator"] == [ReasonCode.INPUT_NOT_MEASURED]
    assert codes["galvanostat"] == [ReasonCode.NO_OUTPUT_MEASURED]


@pytest.mark.parametrize(("friction", "verdict"), [(0.0, "consistent"), (0.5, "wrong")])
@pytest.mark.slow
def test_a_slide_that_runs_away_alone_is_judged_in_its_loop(tmp_path, friction, verdict):
    """By itself it integrates the noise of the tension twice: it would be centimetres off."""
    hidden = {
        "hidden": effects("voice_coil_dma")["coulomb_friction"],
        "values": {"bench.coulomb_force": friction},
    }
    diagnosis = held_bench(tmp_path, **hidden if friction else {})
    assert verdicts(diagnosis) == {"bench": verdict, "actuator": "consistent"}
    bench = diagnosis.members[0]
    assert not any(a.not_assessable for a in bench.final.values())


@pytest.mark.slow
def test_members_of_others_are_judged_too(tmp_path):
    right = diagnosed_lags(tmp_path, 0.0)
    assert verdicts(right) == {"a": "consistent", "b": "consistent"}
    assert sources(right.members[1]) == {"u": "a.x, linear between samples"}
    columns = {str(port): column for port, (column, _) in right.columns.items()}
    assert columns == {"a.u": "drive", "a.x": "a.x", "b.x": "b.x"}
    assert not right.members[0].is_component
    bent = diagnosed_lags(tmp_path, 0.1)
    assert verdicts(bent) == {"a": "consistent", "b": "wrong"}
    slow = diagnosed_lags(tmp_path, 0.0, a=1.4)
    assert verdicts(slow) == {"a": "recalibrate", "b": "consistent"}
    assert slow.members[0].parameters["tau"].value == pytest.approx(1.4, rel=0.01)


@pytest.mark.parametrize("few", [2, 19])
def test_an_output_that_was_hardly_measured_is_judged_all_the_same(tmp_path, few):
    lags(tmp_path, 0.0)
    record = {"drive": np.sin(0.05 * np.arange(200)), "a.x": np.full(200, np.nan)}
    record["a.x"][:few] = 0.3
    write_record(tmp_path / "few.csv", 0.05 * np.arange(200), record, dict.fromkeys(record, "1"))
    diagnosis = diagnose_system(tmp_path / "few.csv", tmp_path / "system.ssp")
    assert diagnosis.members[0].final["x"].whiteness is None
    assert system_diagnosis_summary(diagnosis)["members"][0]["outputs"]["x"]["white"] is None


def test_a_column_twice_and_a_record_too_short_are_refused(tmp_path):
    lags(tmp_path, 0.0)
    two = {"drive": np.zeros(200), "a.u": np.ones(200), "a.x": np.ones(200)}
    write_record(tmp_path / "two.csv", 0.05 * np.arange(200), two, dict.fromkeys(two, "1"))
    with pytest.raises(UserError, match=r"two.csv: .* is a.u, and another column is too"):
        diagnose_system(tmp_path / "two.csv", tmp_path / "system.ssp")
    short = {name: values[:50] for name, values in two.items() if name != "drive"}
    write_record(tmp_path / "short.csv", 0.05 * np.arange(50), short, dict.fromkeys(short, "1"))
    with pytest.raises(UserError, match="50 samples are too few; 100 are the least"):
        diagnose_system(tmp_path / "short.csv", tmp_path / "system.ssp")


def changes(diagnosis):
    """Parameters that are said to differ, by member; and nobody else is blamed."""
    assert {
        m.name for m in diagnosis.members if m.verdict not in ("consistent", "recalibrate")
    } == set()
    return {
        m.name: {n: p.value for n, p in m.parameters.items() if p.differs}
        for m in diagnosis.members
        if m.verdict == "recalibrate"
    }


@pytest.mark.slow
def test_the_limit_of_the_galvanostat(tmp_path):
    diagnosis = watched(
        tmp_path,
        settings={"galvanostat.current_limit": 0.55},
        values={"galvanostat.current_limit": 0.45},
    )
    assert changes(diagnosis) == {"galvanostat": {"current_limit": pytest.approx(0.45, rel=0.002)}}


@pytest.mark.slow
def test_the_voltage_limit_of_the_estimator(tmp_path):
    diagnosis = watched(tmp_path, values={"estimator.initial_voltage_limit": 1.1})
    assert changes(diagnosis) == {
        "estimator": {"initial_voltage_limit": pytest.approx(1.1, rel=0.002)}
    }


@pytest.mark.slow
def test_the_damping_of_the_foot(tmp_path):
    """Two seconds at 200 Hz of a foot that is pulled by its four actuators and pushed at the
    toe.
    """
    system, every = shipped.system("foot_gait"), 50
    grid = 5e-3 * np.arange(400)
    levels = {f"{a}_current": [-1.0, -0.3, 0.3, 1.0] for a in FEET}
    levels |= {f"toe_force_{axis}": [-1.0, 0.0, 1.0] for axis in "xy"}
    inputs = {
        n: np.repeat(multilevel(grid, v, (0.1, 0.4), k), every)
        for k, (n, v) in enumerate(levels.items())
    }
    columns = {name: "A" if name.endswith("current") else "N" for name in inputs}
    columns |= {f"{a}.tension": "N" for a in FEET} | {f"foot.{a}_length_change": "m" for a in FEET}
    columns |= {f"foot.{joint}_angle": "rad" for joint in ("ankle", "tm", "mtp")}
    time = 1e-4 * np.arange(grid.size * every)
    measure(
        tmp_path / "record.csv",
        system,
        columns,
        time,
        inputs,
        every,
        values={"foot.ankle_damping": 0.03},
    )
    ssp.write(system, tmp_path / "system.ssp")
    found = changes(diagnose_system(tmp_path / "record.csv", tmp_path / "system.ssp"))
    assert list(found) == ["foot"]
    assert found["foot"]["ankle_damping"] == pytest.approx(0.03, rel=0.06)  # instead of 0.02
