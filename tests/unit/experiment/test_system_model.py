"""Claims: a system is swept and fitted like a model: its runs are the master's, bit for bit, and
what is held against a record is the bench of the thesis, solved by the exponential of its matrix.
"""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path
from shutil import copyfile

import numpy as np
import pytest

import orchestration as ppy
from fmus import component
from fmus.kit import UserError
from orchestration.experiment.model import Master
from orchestration.experiment.subjects import find_system, is_system
from orchestration.experiment.system_model import fused_model, system_model
from orchestration.fmu.simulation import source_of
from orchestration.system import Member, Port, System, library, ssp
from tests.support.closed_loop import TIME, closed_loop, references
from tests.support.hosts import build_one_state_fmu

STEP = 1e-4  # s, of the bench
POINTS = STEP * np.arange(3001)


@pytest.fixture(scope="module")
def bench():
    return library.system("dma_bench")


@pytest.fixture(scope="module")
def lag(tmp_path_factory):
    return str(build_one_state_fmu(tmp_path_factory.mktemp("lag")))


def test_gains_of_a_loop_come_to_the_bits_of_single_runs(bench):
    gains = [0.3, 0.66, 1.2]
    swept = ppy.sweep(
        "dma_bench",
        {"bench.error_gain": gains, "actuator.k1": [5e3, 7e3]},
        {"force_reference": 1.0},
        time=POINTS,
        outputs=["bench.force_measured"],
        keep=["trace", "last"],
    )
    assert swept["bench.force_measured_last"].units == "N"
    for gain in gains:
        for k1 in (5e3, 7e3):
            changed = bench.given({"bench.error_gain": gain, "actuator.k1": k1})
            single = ppy.run(changed, POINTS, {"force_reference": np.ones(POINTS.size)})
            case = {"bench.error_gain": gain, "actuator.k1": k1}
            traces = swept["bench.force_measured"].sel(case)
            assert np.array_equal(traces, single.signals["bench.force_measured"])
            assert swept["bench.force_measured_last"].sel(case) == traces[-1]


@pytest.mark.slow
def test_workers_come_to_the_same_bits_from_the_file_of_a_system(bench, tmp_path):
    ssp.write(bench, tmp_path / "bench.ssp")
    call = {"time": POINTS[:301], "settings": {"force_reference": 1.0}}
    over = {"bench.error_gain": "0.3..1.2:3"}
    alone = ppy.sweep(bench, over, **call)
    others = ppy.sweep(str(tmp_path / "bench.ssp"), over, workers=2, **call)
    for name in alone:
        assert np.array_equal(alone[name], others[name])


def test_between_points_members_exchange_once_in_a_step(bench):
    sparse = ppy.simulate(bench, {"force_reference": 1.0}, time=POINTS[::30])
    dense = ppy.simulate(bench, {"force_reference": 1.0}, time=POINTS)
    for name, values in sparse.outputs.items():
        assert values == pytest.approx(dense[name][::30], rel=1e-9, abs=1e-12), name


@pytest.mark.parametrize(
    ("method", "step", "off"), [("fused", STEP, 1e-10), ("gauss-seidel", STEP, 2e-6)]
)
def test_the_loop_is_that_of_its_matrix(bench, method, step, off):
    model = system_model(replace(bench, step=step), Master(method=method))
    wanted = references()
    position, _ = closed_loop(wanted)
    run = ppy.simulate(model, {"force_reference": wanted}, time=TIME)
    assert np.abs(run["bench.position"] - position).max() < off


def drawn(seed, b0=0.66):
    """Return a record of the loop with noise of a micrometre and five millinewtons."""
    wanted = references(seed)
    position, force = closed_loop(wanted, k1=6300.0, b_vc=6.0, b0=b0)
    random = np.random.default_rng(seed)
    return {
        "time [s]": TIME,
        "force_reference [N]": wanted,
        "bench.position [m]": position + 1e-6 * random.standard_normal(TIME.size),
        "actuator.tension [N]": force + 5e-3 * random.standard_normal(TIME.size),
    }


@pytest.mark.slow
def test_parameters_of_two_members_are_found_together_in_a_closed_loop(bench):
    names = ["actuator.k1", "bench.b_vc"]
    truth = np.array([6300.0, 6.0])
    starts = {"actuator.k1": "5 N/mm", "bench.b_vc": 8.0}
    covered = []
    for seed in range(12):
        fitted = ppy.fit(drawn(seed), bench, names, settings=starts)
        low, high = np.array([fitted.intervals[name] for name in names]).T
        assert [*fitted.values.values()] == pytest.approx(truth, rel=0.03)
        covered.append((low < truth) & (truth < high))
    # of 12 intervals of 95 % four or more miss with a probability of 0.2 %
    assert (np.sum(covered, axis=0) >= 9).all()


def test_a_comparison_tells_the_noise_of_the_right_system(bench):
    compared = ppy.compare(drawn(1), bench)
    assert compared.before["bench.position"].rms == pytest.approx(1e-6, rel=0.1)
    assert compared.before["actuator.tension"].rms == pytest.approx(5e-3, rel=0.1)


def test_what_cannot_be_fused_is_run_by_the_master_and_says_so(lag):
    member = Member("one", Path(lag))
    port = Port("one", "u")
    system = System("s", (member,), (), {"u": (port,)}, step=0.1)
    model = fused_model(system)
    assert "exchange values once in 0.1 s" in model.notes[0]
    assert source_of(model).master.method == "gauss-seidel"
    assert model.foreign
    time = 0.1 * np.arange(400)
    u = np.repeat([1.0, -2.0, 0.5, 3.0], 100)
    x = np.zeros(400)
    for k in range(399):
        x[k + 1] = u[k] + (x[k] - u[k]) * np.exp(-0.1 / 0.8)
    noisy = x + np.random.default_rng(1).normal(0.0, 0.02, 400)
    columns = {"time [s]": time, "u [1]": u, "one.x [1]": noisy}
    fitted = ppy.fit(columns, system, ["one.tau"], settings={"one.tau": 1.5})
    low, high = fitted.intervals["one.tau"]
    assert low < 0.8 < high
    assert high - low < 0.05


def test_a_system_has_the_values_of_its_members(bench):
    model = system_model(bench.given({"actuator.k1": 5e3}))
    assert model.parameters["actuator.k1"].start == 5e3
    assert model.parameters["actuator.k1"].unit == "N/m"
    assert [*model.inputs] == ["force_reference", "current"]
    assert model.kept == (
        "actuator.tension",
        "actuator.voltage",
        "bench.position",
        "bench.force_measured",
    )
    assert "bench.hold" in model.parameters
    assert not {"bench.tension", "bench.force_reference"} & {*model.parameters}


def test_the_digest_is_of_what_is_run(bench):
    first = source_of(system_model(bench))
    assert first.guid == source_of(system_model(bench)).guid
    for other in (
        bench.given({"actuator.k1": 5e3}),
        replace(bench, step=2e-4),
        replace(bench, connections=bench.connections[:1]),
    ):
        assert source_of(system_model(other)).guid != first.guid
    assert source_of(system_model(bench, Master(method="jacobi"))).guid != first.guid


@pytest.mark.parametrize("method", ["gauss-seidel", "fused"])
def test_it_runs_from_copies_of_its_files_in_another_process(bench, method, tmp_path):
    source = source_of(system_model(bench, Master(method=method)))
    copies = [tmp_path / f"{k}.fmu" for k in range(len(source.files))]
    for path, copy in zip(source.files, copies, strict=True):
        copyfile(path, copy)
    sent = pickle.loads(pickle.dumps(source.with_files(copies)))
    assert sent.files == tuple(copies)
    given = (POINTS[:100], {"force_reference": np.ones(100)}, {}, ["bench.position"])
    with source.open() as one, sent.open() as other:
        assert np.array_equal(one.run(*given), other.run(*given))


def test_a_run_that_takes_too_long_ends(bench):
    with source_of(system_model(bench)).open() as runs, pytest.raises(UserError, match="longer"):
        runs.run(POINTS, {}, {}, ["bench.position"], 0.0)


@pytest.mark.parametrize(
    ("act", "message"),
    [
        (
            lambda: ppy.sweep("dma_bench", {"bench.error_gian": "0..1:2"}),
            "dma_bench: no parameter or input named 'bench.error_gian'"
            " (did you mean bench.error_gain?)",
        ),
        (
            lambda: ppy.fit(drawn(1), "dma_bench", ["actuator.kk1"]),
            "dma_bench has no parameter named 'actuator.kk1' (did you mean actuator.k1?)",
        ),
        (
            lambda: ppy.sweep("dma_bnch", {"bench.m": "0.1,0.2"}),
            "no component and no system named 'dma_bnch' (did you mean dma_bench?)",
        ),
        (
            lambda: ppy.simulate("dma_bench", {"force": 1.0}),
            "dma_bench: no input named 'force' (did you mean force_reference?)",
        ),
    ],
)
def test_bad_names_are_refused_in_a_line(act, message):
    with pytest.raises(UserError) as refused:
        act()
    assert str(refused.value) == message


def test_a_system_of_a_file_has_no_other_build_to_choose():
    with pytest.raises(UserError, match=r"runtime='python': any\.ssp is taken as it is"):
        find_system("any.ssp", "python")


def test_a_component_comes_before_a_system_of_its_name():
    assert is_system("dma_bench")
    assert is_system("any.ssp")
    assert not is_system("isotonic_stand")
    assert not is_system("ppy_actuator")
    assert find_system("dma_bench").name == "dma_bench"
    assert component("isotonic_stand").name == "isotonic_stand"
