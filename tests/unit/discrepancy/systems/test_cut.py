"""Which member of a system is wrong: records of closed loops, made without any FMU, are cut open and judged."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.signal import lfilter

from fmus import effects
from fmus.kit.errors import UserError
from orchestration.cli import diagnose_system as screen_members
from orchestration.discrepancy.systems.adjust import _Search
from orchestration.discrepancy.systems.cut import cut, names, read
from orchestration.discrepancy.systems.diagnose import Effort, diagnose_system
from orchestration.discrepancy.systems.member import opened
from orchestration.experiment.waveforms import multilevel
from orchestration.records import write_record
from orchestration.system import Member, Port, System, connect, library, ssp
from orchestration.system.model import Connection
from tests.support.hosts import build_one_state_fmu
from tests.support.system.closed_loop import NOISE, WATCH, measure, watched

BENCH = {
    "force_reference": "N", "current": "A", "actuator.tension": "N", "actuator.voltage": "V", "bench.position": "m",
    "bench.force_measured": "N",
}  # fmt: skip


def held_bench(folder, **hidden):
    """Bench over six seconds at 100 Hz."""
    system, every = library.system("dma_bench"), 10
    grid = 0.01 * np.arange(600)
    inputs = {
        "force_reference": np.repeat(multilevel(grid, [0.5, 1.0, 2.0, 3.0], (0.5, 2.0), 1), every),
        "current": np.repeat(multilevel(grid, [-1.0, -0.3, 0.5, 1.2], (0.5, 2.0), 2), every),
    }
    time = 0.001 * np.arange(600 * every)
    measure(folder / "record.csv", system, BENCH, time, inputs, every, **hidden)
    ssp.write(system, folder / "system.ssp")
    return diagnose_system(folder / "record.csv", folder / "system.ssp", effort=Effort(simulations=30, parameters=2))


def verdicts(found):
    return {m.name: m.verdict for m in found.members}


ALL_RIGHT = {"estimator": "consistent", "galvanostat": "consistent", "actuator": "consistent"}


def test_a_record_of_the_system_itself_blames_nobody(tmp_path):
    found = watched(tmp_path)
    assert verdicts(found) == ALL_RIGHT
    assert found.verdict == "consistent"
    estimator = found.members[0]
    assert "voltage_limit does not move in this record" in estimator.why
    actuator = found.members[2]
    assert actuator.fed["current"] == "galvanostat.current, held between samples"
    for output, unit in (("voltage", "V"), ("displacement", "m")):
        assert actuator.final[output].noise == pytest.approx(NOISE[unit], rel=0.1)
    text = json.dumps(found.as_json(), allow_nan=False)
    assert json.loads(text)["members"][2]["model"] == "ageing_actuator"


def test_the_member_with_another_structure_is_named(tmp_path):
    found = watched(
        tmp_path,
        hidden=effects("ppy_actuator")["strain_saturation"],
        values={"actuator.strain_saturation_coefficient": 0.3},
    )
    assert verdicts(found) == ALL_RIGHT | {"actuator": "wrong"}
    assert found.wrong == ["actuator"]
    actuator = found.members[2]
    assert not actuator.final["voltage"].wrong
    assert "displacement is off by" in actuator.why
    assert "whatever its parameters" in actuator.why


def test_a_member_with_another_parameter_is_recalibrated(tmp_path):
    found = watched(tmp_path, values={"actuator.R1": 1.4 * 0.43})
    assert verdicts(found) == ALL_RIGHT | {"actuator": "recalibrate"}
    changed = {n: c for n, c in found.members[2].parameters.items() if c.differs}
    assert list(changed) == ["R1"]
    assert changed["R1"].value == pytest.approx(1.4 * 0.43, rel=0.01)
    assert found.members[2].why == f"R1 is {changed['R1'].value:.4g} ohm instead of 0.43"


def test_what_to_measure_is_told(tmp_path):
    few = {name: unit for name, unit in WATCH.items() if name != "galvanostat.current"}
    found = watched(tmp_path, few)
    why = {m.name: m.why for m in found.members}
    assert why["actuator"] == "current is not measured (measure galvanostat.current)"
    assert why["galvanostat"] == "none of its outputs is measured"
    assert set(verdicts(found).values()) == {"cannot be judged"}


@pytest.mark.parametrize(("friction", "verdict"), [(0.0, "consistent"), (0.5, "wrong")])
def test_a_slide_that_runs_away_alone_is_judged_in_its_loop(tmp_path, friction, verdict):
    """By itself it integrates the noise of the tension twice: it would be centimetres off."""
    hidden = {"hidden": effects("voice_coil_dma")["coulomb_friction"], "values": {"bench.coulomb_force": friction}}
    found = held_bench(tmp_path, **hidden if friction else {})
    assert verdicts(found) == {"bench": verdict, "actuator": "consistent"}
    bench = found.members[0]
    assert not any(j.lost for j in bench.final.values())


# --- FMUs of others: a hand-written lag, tau dx/dt = u - x -----------------------------------------------------------


def lags(folder, gain=1.0, **taus):
    """A lag that feeds a lag, and the record of it in closed form, the second read by a sensor that is not straight."""
    fmu = build_one_state_fmu(folder)
    system = System(
        "lags", (Member("a", fmu), Member("b", fmu, {"tau": 3.0})),
        (Connection(Port("a", "x"), Port("b", "u"), factor=2.0, offset=0.5),), {"drive": (Port("a", "u"),)}, step=0.05,
    )  # fmt: skip
    ssp.write(system, folder / "system.ssp")
    fine = 20  # parts of a sample
    time = 0.05 / fine * np.arange(2000 * fine)
    drive = np.repeat(multilevel(time[::fine], [0.0, 0.4, 1.0], (0.5, 4.0), 5), fine)

    def lagged(signal, tau):
        keep = np.exp(-0.05 / fine / tau)
        return lfilter([0.0, 1.0 - keep], [1.0, -keep], signal)

    first = lagged(drive, taus.get("a", 1.0))
    second = lagged(2.0 * first + 0.5, taus.get("b", 3.0))
    random = np.random.default_rng(1)
    record = {"drive": drive, "a.x": first, "b.x": second + gain * second * (second - 1.25)}
    record = {n: v[::fine] + 0.003 * (n != "drive") * random.standard_normal(2000) for n, v in record.items()}
    write_record(folder / "record.csv", time[::fine], record, dict.fromkeys(record, "1"))
    return system, diagnose_system(folder / "record.csv", folder / "system.ssp")


def test_members_of_others_are_judged_too(tmp_path):
    _, right = lags(tmp_path, 0.0)
    assert verdicts(right) == {"a": "consistent", "b": "consistent"}
    assert right.members[1].fed == {"u": "a.x, linear between samples"}
    assert not right.members[0].ours
    _, bent = lags(tmp_path, 0.1)
    assert verdicts(bent) == {"a": "consistent", "b": "wrong"}
    _, slow = lags(tmp_path, 0.0, a=1.4)
    assert verdicts(slow) == {"a": "recalibrate", "b": "consistent"}
    assert slow.members[0].parameters["tau"].value == pytest.approx(1.4, rel=0.01)


def test_the_error_of_a_parameter_is_that_of_the_best_point_whatever_was_tried_after_it(tmp_path):
    system, _ = lags(tmp_path, 0.0, a=1.4)
    record, measured = read(tmp_path / "record.csv", system, {})
    part = cut(system, measured, {})[0]
    with opened(part, record.time, 50, lambda made: None) as alone:
        alone.choose_holding({})
        search = _Search(alone, alone.simulate({}))
        search.names = ["tau"]
        search.fit(search.start)
        error, best = search.spread(), search.values(search.best.q)
        alone.simulate({"tau": 20.0})
        search._rows(search.start + 3.0)
        assert search.spread() == error
        # white noise of 0.003, and the slope by the logarithm of tau at the best point
        up, down = (alone.simulate({"tau": best["tau"] * np.exp(sign * 0.01)})["x"] for sign in (1.0, -1.0))
        slope = (up - down) / 0.02
        assert best["tau"] == pytest.approx(1.4, rel=0.01)
        assert error[0] == pytest.approx(0.003 / np.sqrt(slope @ slope), rel=0.1)


# --- what is cut where ----------------------------------------------------------------------------------------------


def test_signals_have_all_their_names_and_arrive_converted(tmp_path):
    fmu = build_one_state_fmu(tmp_path)
    system = System(
        "two", (Member("a", fmu), Member("b", fmu)),
        (Connection(Port("a", "x"), Port("b", "u"), factor=2.0, offset=0.5),), {"drive": (Port("a", "u"),)},
        {"shown": Port("b", "x")},
    )  # fmt: skip
    known = names(system)
    assert (known["drive"], known["shown"]) == (Port("a", "u"), Port("b", "x"))
    assert "x" not in known
    values = np.linspace(0.0, 1.0, 50)
    first, second = cut(system, {Port("a", "x"): values, Port("b", "x"): values}, {Port("a", "u"): 1.0})
    assert first.inputs["u"].value == 1.0
    assert second.inputs["u"].values == pytest.approx(2.0 * values + 0.5)
    back, _ = cut(system, {Port("b", "u"): values}, {})  # measured where it arrives
    assert back.outputs["x"] == pytest.approx((values - 0.5) / 2.0)
    assert back.missing == {"u": "drive"}
    assert back.obstacle == "u is not measured (measure drive)"
    holes = np.where(values > 0.5, np.nan, values)
    assert "without holes" in cut(system, {Port("a", "x"): holes, Port("b", "x"): values}, {})[1].obstacle


def test_a_name_that_all_ends_share_needs_no_member(tmp_path):
    fmu = build_one_state_fmu(tmp_path)
    ring = System("ring", (Member("a", fmu), Member("b", fmu)), connect("a.x -> b.u", "b.x -> a.u"))
    assert "u" not in names(ring)
    fed = System("fed", (Member("a", fmu), Member("b", fmu)), (), {"d": (Port("a", "u"), Port("b", "u"))})
    assert names(fed)["u"] == Port("a", "u")


@pytest.mark.parametrize("few", [2, 19])
def test_an_output_that_was_hardly_measured_is_judged_all_the_same(tmp_path, few):
    lags(tmp_path, 0.0)
    record = {"drive": np.sin(0.05 * np.arange(200)), "a.x": np.full(200, np.nan)}
    record["a.x"][:few] = 0.3
    write_record(tmp_path / "few.csv", 0.05 * np.arange(200), record, dict.fromkeys(record, "1"))
    found = diagnose_system(tmp_path / "few.csv", tmp_path / "system.ssp")
    assert found.members[0].final["x"].whiteness is None
    assert found.as_json()["members"][0]["outputs"]["x"]["white"] is None


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


def test_a_folder_is_refused_before_anything_is_read(tmp_path):
    with pytest.raises(UserError, match=r"^--json .*: this is a folder; name a file in it$"):
        screen_members.run(tmp_path / "no.csv", tmp_path / "no.ssp", [], [], tmp_path, {})
