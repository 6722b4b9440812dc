"""Records of a rig that is driven by an experiment.

Every row has what belongs together and nothing old, however the run ends.
"""

from __future__ import annotations

import json
import signal
import subprocess
import threading
import time
import tomllib

import numpy as np
import pytest
import xarray
from pyarrow import parquet

from orchestration.experiment import results
from orchestration.rig.keys import make_keys
from tests.support.command import here, posix, recording, refused, running
from tests.support.pace import slow_but
from tests.support.rig.small_rig import (
    INPUTS,
    LEVELS,
    LIMITS,
    OUTPUTS,
    SmallRig,
    free_port,
    small_rig_process,
)

pytestmark = pytest.mark.real_time


SOME = 12  # exchanges, after which something happens: counted, as a loaded machine takes its time


def record(rig, folder, stimulus, *more, out="run.nc"):
    return here(*recording(rig.endpoint, stimulus, *more, out=out), cwd=folder)


def recorded(rig, folder, stimulus, *more, out="run.nc"):
    """Make a record, and check that it says what it lacks, as much as a busy machine lets it."""
    done = record(rig, folder, stimulus, *more, out=out)
    assert not list(folder.glob("*.part.csv"))
    data = results.read(folder / out)
    rows = np.column_stack([column.values for column in data.values()])
    gaps = int(np.isnan(rows).any(axis=1).sum())
    assert (data.attrs["gaps"], data.attrs["complete"]) == (gaps, int(gaps == 0))
    assert done.returncode == (1 if gaps else 0), done.stderr
    if gaps:
        assert f"error: {gaps} of {len(rows)} rows lack a value" in done.stderr.splitlines()[-1]
    return data


def belongs_together(data):
    """Check that every output is that of the inputs of its own row, and not of the row before."""
    np.testing.assert_allclose(data.voltage, 0.6 * data.current, rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        data.displacement, 1e-4 * data.force - 2e-5 * data.current, rtol=0, atol=1e-12
    )


@pytest.mark.parametrize("period", slow_but([0.005, 0.02, 0.03, 0.05], 0.005, 0.05))
def test_an_output_belongs_to_the_command_of_its_row(tmp_path, experiment, period):
    with SmallRig(period=period) as rig:
        data = recorded(rig, tmp_path, experiment())
        sent = [message["values"] for message in rig.of_type("exchange")]
        assert rig.client == ""
        assert rig.state == "idle"
        assert rig._commands == {"current": 0.0, "force": 0.0}
    assert data.sizes["time"] == 21
    np.testing.assert_allclose(data.time, 0.05 * np.arange(21), atol=1e-12)
    heard = np.isfinite(data.voltage.values)
    assert heard.mean() > 0.7  # of a machine that others use too; alone it is all of them
    belongs_together(data.isel(time=heard))
    steps = [values for k, values in enumerate(sent) if k == 0 or values != sent[k - 1]]
    known = np.isfinite(data.current.values)
    assert (
        set(data.current.values[known]) <= {values[0] for values in steps} <= {-0.9, 0.0, 0.5, 1.2}
    )


def test_it_is_the_signal_that_ppy_run_would_send(tmp_path, experiment):
    path = experiment()
    with SmallRig(period=0.01) as rig:
        data = recorded(rig, tmp_path, path)
    done = here("run", path, "--out", "model.nc", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    model = results.read(tmp_path / "model.nc")
    known = np.isfinite(data.current.values)
    np.testing.assert_array_equal(data.current.values[known], model.current.values[known])
    np.testing.assert_array_equal(data.time, model.time)
    expected = {
        "title": "Levels",
        "seed": 3,
        "duration": 1.0,
        "step": 0.05,
        "over": "time",
    }
    assert {name: data.attrs[name] for name in expected} == expected
    assert set(model.attrs) <= set(data.attrs)
    assert json.loads(data.attrs["experiment"]) == json.loads(model.attrs["experiment"])
    assert {name: a.role for name, a in data.items()} == {
        "current": "input",
        "force": "input",
        "voltage": "output",
        "displacement": "output",
        "voltage_age": "output",
        "displacement_age": "output",
    }
    assert {name: a.units for name, a in data.items()} == INPUTS | OUTPUTS | {
        f"{name}_age": "s" for name in OUTPUTS
    }


def test_what_the_experiment_wants_recorded(tmp_path, experiment):
    path = experiment(0.3)
    with SmallRig() as rig:
        only = recorded(rig, tmp_path, path, "--set", 'record=["displacement", "charge"]')
        whatever = recorded(
            rig,
            tmp_path,
            experiment(0.3, text=LEVELS.replace('record = ["voltage"', '# ["voltage"')),
        )
        unmeasured = ("--set", 'record=["charge"]')
        refused(
            tmp_path,
            *recording(rig.endpoint, path, *unmeasured, out="other.nc"),
            parts=["record", "voltage, displacement"],
        )
    assert list(only) == ["current", "force", "displacement", "displacement_age"]
    assert {"voltage", "displacement"} <= set(whatever)


def test_every_format(tmp_path, experiment):
    path = experiment(0.3)
    with SmallRig() as rig:
        for out in ("run.nc", "run.csv", "run.parquet"):
            assert record(rig, tmp_path, path, out=out).returncode in (0, 1)
    names = ["current", "force", "voltage", "displacement", "voltage_age", "displacement_age"]
    assert list(xarray.load_dataset(tmp_path / "run.nc", engine="scipy")) == names
    units = ["A", "N", "V", "m", "s", "s"]
    header = ["time [s]", *(f"{name} [{unit}]" for name, unit in zip(names, units, strict=True))]
    assert (tmp_path / "run.csv").read_text().splitlines()[0] == ",".join(header)
    assert parquet.read_table(tmp_path / "run.parquet").column_names == header


def test_ages_are_those_that_the_rig_told(tmp_path, experiment):
    with SmallRig(period=0.05) as rig:
        data = recorded(rig, tmp_path, experiment())
    ages = data.voltage_age.values[np.isfinite(data.voltage_age.values)]
    assert ages.size
    assert (ages >= 0.0).all()
    assert (ages < 0.06 + 0.05).all()  # a period, and what a machine that others use may add


def test_what_is_not_measured_any_more_is_a_gap(tmp_path, experiment):
    def fails(inputs, now):
        return {"voltage": None, "displacement": 1e-4 * inputs["force"]}

    with SmallRig() as rig:
        rig.then[SOME] = lambda: setattr(rig, "plant", fails)
        data = recorded(rig, tmp_path, experiment(2.0))
    assert np.isfinite(data.voltage.values[:4]).any()
    assert np.isnan(data.voltage.values[-8:]).all()
    assert np.isnan(data.voltage_age.values[-8:]).all()
    assert np.isfinite(data.displacement.values[-8:]).any()


def test_an_old_value_never_looks_fresh(tmp_path, experiment):
    """The rig goes on answering with a value that grows older, and belongs to no command."""
    with SmallRig() as rig:
        rig.then[SOME] = lambda: setattr(rig, "measures", False)
        data = recorded(rig, tmp_path, experiment(2.0))
    assert np.isnan(data.voltage.values[-5:]).all()
    assert np.isfinite(data.current.values[-5:]).any()


@pytest.mark.slow
def test_max_age(tmp_path, experiment):
    still = (
        LEVELS.replace('kind = "multilevel"', 'kind = "constant"').split("levels =")[0]
        + 'value = "0.5 A"\n'
    )
    path = experiment(1.5, 0.05, still)
    for max_age, last in (("0.2s", False), ("5s", True)):
        with SmallRig() as rig:
            rig.then[SOME] = lambda rig=rig: setattr(rig, "measures", False)
            data = recorded(rig, tmp_path, path, "--max-age", max_age)
        assert np.isfinite(data.voltage.values[5])
        assert (
            np.isfinite(data.voltage.values[-1]) == last
        )  # the input stands still, so that it would belong to it
        told = data.voltage_age.values[np.isfinite(data.voltage_age.values)]
        assert told.max() < (0.2 if not last else 5.0)


def test_a_record_of_gaps_alone_is_no_success(tmp_path, experiment):
    with SmallRig() as rig:
        done = record(rig, tmp_path, experiment(0.3), "--max-age", "1e-9s")
    assert done.returncode == 2
    assert (
        "run.nc holds no measured value: none was younger than 1e-09 s (--max-age)" in done.stderr
    )
    assert (tmp_path / "run.nc").exists()


def test_rate_and_set(tmp_path, experiment):
    with SmallRig(period=0.01) as rig:
        data = recorded(
            rig,
            tmp_path,
            experiment(),
            "--rate",
            40,
            "--set",
            "duration=0.5",
            "--set",
            "inputs.force=2 N",
        )
    np.testing.assert_allclose(data.time, 0.025 * np.arange(21), atol=1e-12)
    assert set(data.force.values[np.isfinite(data.force.values)]) == {2.0}


def test_with_keys(tmp_path, experiment):
    server, client = make_keys(tmp_path / "keys")
    with SmallRig(keys=server) as rig:
        data = recorded(rig, tmp_path, experiment(0.3), "--credentials", client)
    assert data.sizes["time"] == 7
    assert "failure" not in data.attrs


@pytest.mark.slow
def test_a_slow_step_is_kept_alive(tmp_path, experiment):
    """A step that is longer than the watchdog time: commands have to come more often than rows."""
    with SmallRig(period=0.1, watchdog=0.2) as rig:
        data = recorded(rig, tmp_path, experiment(3.0, 0.5))
    assert "failure" not in data.attrs
    belongs_together(data.isel(time=np.isfinite(data.voltage.values)))


def test_a_record_that_a_killed_run_left_is_not_lost(tmp_path, experiment):
    path = experiment()
    (tmp_path / "run.nc.part.csv").write_text("mine")
    with SmallRig() as rig:
        refused(tmp_path, *recording(rig.endpoint, path), parts=["run.nc.part.csv"])
        assert rig.of_type("connect") == []


def incomplete(done, folder, *parts, out="run.nc", code=1):
    """Check status, message and file of a record that ended early, and return its data."""
    assert done.returncode == code, (done.stdout, done.stderr)
    assert "Traceback" not in done.stderr
    for part in parts:
        assert part in done.stderr.splitlines()[-1]
    data = results.read(folder / out)
    assert data.attrs["complete"] == 0
    assert 1 <= data.sizes["time"] < 101
    assert np.isfinite(data.voltage.values).any()
    return data


def test_the_safe_state_ends_it(tmp_path, experiment):
    with SmallRig() as rig:
        rig.then[SOME] = lambda: rig.safe("voltage 1.01 V is above 1 V")
        done = record(rig, tmp_path, experiment(5.0))
    data = incomplete(done, tmp_path, "safe state", "voltage 1.01 V is above 1 V", "run.nc holds")
    assert "voltage 1.01 V is above 1 V" in data.attrs["failure"]


def test_a_refused_command_ends_it(tmp_path, experiment):
    with SmallRig() as rig:
        tight = {**LIMITS, "current": {"min": -0.1, "max": 0.1, "rate": None}}
        rig.then[SOME] = lambda: setattr(rig, "limits", tight)
        done = record(rig, tmp_path, experiment(5.0))
    incomplete(done, tmp_path, "refused a command", "beyond its limit")


def test_a_lost_link_ends_it(tmp_path, experiment):
    with SmallRig() as rig:
        rig.then[SOME] = lambda: setattr(rig, "answers", False)
        began = time.monotonic()
        done = record(rig, tmp_path, experiment(30.0))
        assert (
            time.monotonic() - began < 15.0
        )  # 0.6 s, the second of silence, and what a loaded machine needs besides
    assert done.stderr.count("ALARM: no answer from tcp://") == 1  # before the end, and once
    data = incomplete(done, tmp_path, "no answer from tcp://")
    assert np.isnan(data.voltage.values[-3:]).all()
    assert np.isnan(data.current.values[-3:]).all()  # nobody knows what was applied


def kills(server, journal):
    """End a server once a journal has rows."""
    while not (journal.exists() and len(journal.read_text().splitlines()) > SOME):
        time.sleep(0.02)
    server.kill()


def test_a_server_that_is_killed(tmp_path, experiment):
    port = free_port()
    with small_rig_process(port) as server:
        threading.Thread(
            target=kills, args=(server, tmp_path / "run.nc.part.csv"), daemon=True
        ).start()
        done = here(*recording(f"tcp://127.0.0.1:{port}", experiment(30.0)), cwd=tmp_path)
    incomplete(done, tmp_path, "no answer from tcp://")


def test_a_server_that_was_started_again_knows_no_such_session(tmp_path, experiment):
    with SmallRig() as rig:
        rig.then[SOME] = lambda: setattr(rig, "session", "another")
        done = record(rig, tmp_path, experiment(5.0))
    incomplete(done, tmp_path, "no such session")


@pytest.mark.slow
@posix
@pytest.mark.parametrize("number", slow_but([signal.SIGINT, signal.SIGTERM], signal.SIGINT))
def test_ctrl_c_writes_what_there_is(tmp_path, experiment, number):
    with SmallRig() as rig:
        driving = running(*recording(rig.endpoint, experiment(60.0)), cwd=tmp_path)
        while len(rig.of_type("exchange")) < 20:
            time.sleep(0.05)
            assert driving.poll() is None
        driving.send_signal(number)
        out, err = driving.communicate(timeout=30)
        assert rig.of_type("disconnect")
        assert rig.state == "idle"
    done = subprocess.CompletedProcess([], driving.returncode, out, err)
    data = incomplete(done, tmp_path, "interrupted", code=130)
    assert "failure" not in data.attrs
    assert not list(tmp_path.glob("*.part.csv"))


@pytest.mark.slow
@posix
def test_killed_it_leaves_the_journal(tmp_path, experiment):
    with SmallRig() as rig:
        driving = running(*recording(rig.endpoint, experiment(60.0)), cwd=tmp_path)
        journal = tmp_path / "run.nc.part.csv"
        until = time.monotonic() + 30.0
        while not (journal.exists() and len(journal.read_text().splitlines()) > 20):
            assert time.monotonic() < until
            time.sleep(0.1)
        driving.kill()
        driving.communicate()
    header, *rows = journal.read_text().splitlines()
    assert header.startswith("time [s],current [A],force [N],voltage [V]")
    assert all(len(row.split(",")) == 7 for row in rows)


@pytest.mark.slow
@posix
def test_a_full_disk_costs_one_line(tmp_path, experiment, monkeypatch):
    """A limit on the size of files stands for it: the system refuses to write in the same way."""

    import resource  # which Windows does not have

    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000))

    # compiled modules would be cut off where they lie, for all that come later
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    with SmallRig() as rig:
        arguments = recording(rig.endpoint, experiment(4.0))
        driving = running(*arguments, cwd=tmp_path, before=limit)
        _, err = driving.communicate(timeout=60)
        until = time.monotonic() + 10.0
        while not rig.of_type("disconnect"):  # it is on its way
            assert time.monotonic() < until, err
            time.sleep(0.01)
    assert driving.returncode == 2
    assert "Traceback" not in err
    errors = [line for line in err.splitlines() if line.startswith("error: ")]
    assert errors == err.splitlines()[-1:]
    assert "run.nc" in errors[0]
    assert "run.nc.part.csv" in errors[0]  # what is kept
    kept = (tmp_path / "run.nc.part.csv").read_text()
    assert 0 < len(kept) <= 3000
    assert kept.startswith("time [s],current [A]")


def test_a_designed_experiment_runs_as_it_stands(tmp_path):
    """The form that ppy diagnose --experiment writes, with effects, parameters and limits."""
    text = """# Experiment to tell strain_saturation and diffusion apart
# Limits kept: current -1.3 to 1.3 A; force 0 to 3 N.
title = "Telling apart strain_saturation, diffusion"
component = "ppy_actuator"
effects = ["strain_saturation"]
duration = "1.2 s"
step = "0.1 s"
record = ["voltage", "displacement"]

[parameters]
R1 = 0.61
q_saturation_inverse = 0.9

[inputs.current]
kind = "multilevel"
levels = ["-1.3 A", "0.0 A", "1.3 A"]
dwell = ["0.2 s", "0.4 s"]
seed = 2

[inputs.force]
kind = "steps"
times = [0.3, 0.6]
levels = ["3.0 N", "0.5 N"]
initial = "1.0 N"
"""
    path = tmp_path / "ProposedExperiment.toml"
    path.write_text(text)
    assert tomllib.loads(text)["effects"]
    with SmallRig() as rig:
        data = recorded(rig, tmp_path, path)
    belongs_together(data.isel(time=np.isfinite(data.voltage.values)))


def test_a_shipped_one_by_its_name(tmp_path):
    with SmallRig() as rig:
        data = recorded(rig, tmp_path, "fig_3_3", "--set", "duration=0.5")
    assert data.attrs["title"].startswith("Fig. 3-3")
    assert set(data) == {
        "current",
        "force",
        "voltage",
        "displacement",
        "voltage_age",
        "displacement_age",
    }
