"""Claims: whatever an FMU does to its process, it is told in a line, what was computed is kept, and
nothing is left.

Oracles: acts compiled from C, and the closed form of what is computed until then.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time

import numpy as np
import psutil
import pytest

import orchestration as ppy
from fmus.kit import UserError
from orchestration.fmu.isolation.limits import Limits
from orchestration.fmu.simulation.simulation import UnfinishedSimulation
from orchestration.master import Stopped, run
from orchestration.records import read_record
from orchestration.system.model import Connection, Member, Port, System
from tests.support.hosts import build_one_state_fmu
from tests.support.misbehaving import ACTS, END, START, build
from tests.support.pace import slow_but

TIME = 0.1 * np.arange(31)
REACHED = 11  # points until the step that begins at 1 s
PATIENCE = Limits(step_timeout=20.0, memory=6e8)  # what ends by itself may take its time to do so
HURRY = Limits(step_timeout=1.0, memory=6e8)  # what hangs takes a processor until it is ended
WAYS = {"kernel": {}, "python": {"extrapolation": 1}}
# one of every place and of every way to end, of which a simulation is shown all
EACH_KIND = (
    "exits",
    "kills_itself",
    "sleeps",
    "is_fatal",
    "crashes_as_it_is_read",
    "crashes_as_it_begins",
    "crashes_as_it_is_freed",
    "changes_the_folder",
    "closes_every_file",
    "leaves_a_process_and_aborts",
)
UNTOLD = (
    "closes_every_file",
    "writes_to_every_file",
)  # by its own process, which has no way left to tell what it does
DAMAGED = ("writes_to_every_file",)  # and so is what was computed


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("misbehaving")


@pytest.fixture(scope="module")
def lag(folder):
    return build_one_state_fmu(folder)


@pytest.fixture
def nothing_left(tmp_path, monkeypatch):
    """No process, and no folder."""
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))  # also of what FMUs start
    yield
    assert list((tmp_path / "tmp").iterdir()) == []
    assert children(tmp_path) == []


def children(folder):
    """Processes that run FMUs in a folder, whoever started them, and what these have become."""
    found = []
    for process in psutil.process_iter(["cmdline", "environ", "status"]):
        about = process.info
        named = " ".join([*(about["cmdline"] or ()), *(about["environ"] or {}).values()])
        if (
            str(folder) in named
            and process.pid != os.getpid()
            and about["status"] != psutil.STATUS_ZOMBIE
        ):
            found.append(process)
    return found


def response(points):
    """The lag's, to a step."""
    return 1.0 - np.exp(-TIME[:points])


def limits_for(told):
    """Limits for an act by what is told of it."""
    return HURRY if "answer" in told else PATIENCE


@pytest.mark.parametrize("name", slow_but(ACTS, *EACH_KIND))
def test_a_simulation(name, folder, nothing_left):
    where, _, told = ACTS[name]
    call = (str(build(name, folder)), {"u": 1.0})
    limits = limits_for(told)
    if not told:
        found = ppy.simulate(*call, time=TIME, isolate=limits)
        np.testing.assert_allclose(found["x"], response(31), atol=1e-12)
        return
    with pytest.raises(UserError, match=f"^{name}.fmu: ") as refused:
        ppy.simulate(*call, time=TIME, isolate=limits)
    message = str(refused.value)
    assert told in message
    assert "\n" not in message
    if where == START:
        assert "loading" in message
        assert not isinstance(refused.value, UnfinishedSimulation)
        return
    if name in DAMAGED:
        return
    assert isinstance(refused.value, UnfinishedSimulation)
    reached = 31 if where == END else len(refused.value.time) if name in UNTOLD else REACHED
    np.testing.assert_array_equal(refused.value.time, TIME[:reached])
    np.testing.assert_allclose(refused.value.outputs["x"], response(reached), atol=1e-12)
    if where != END and name not in UNTOLD:
        assert "from 1 s" in message or "at 1.1 s" in message


def three(lag, bad):
    """A chain of three, of which the second misbehaves."""
    links = (Connection(Port("a", "x"), Port("b", "u")), Connection(Port("b", "x"), Port("c", "u")))
    members = (Member("a", lag), Member("b", bad), Member("c", lag))
    return System("three", members, links, {"u": (Port("a", "u"),)}, step=0.1, stop=3.0)


@pytest.mark.parametrize(
    ("way", "name"),
    slow_but(
        [(way, name) for way in WAYS for name in ACTS],
        *(("kernel", name) for name in ("exits", "is_fatal", "crashes_as_it_begins")),
        *(("python", name) for name in ("exits", "sleeps", "changes_the_folder")),
    ),
)
def test_a_run_of_three(way, name, folder, lag, nothing_left):
    (where, _, told), options = ACTS[name], WAYS[way]
    system = three(lag, build(name, folder))
    expected = run(three(lag, lag), TIME, {"u": np.ones(31)}, **options)
    limits = limits_for(told)
    if not told:
        found = run(system, TIME, {"u": np.ones(31)}, isolation=limits, **options)
        assert found.complete
        assert found.signals["c.x"].tobytes() == expected.signals["c.x"].tobytes()
        return
    with pytest.raises(UserError) as refused:
        run(system, TIME, {"u": np.ones(31)}, isolation=limits, **options)
    assert told in str(refused.value)
    assert "\n" not in str(refused.value)
    if name in UNTOLD:
        return
    assert str(refused.value).startswith(f"b: {name}.fmu: ")
    if where != START:
        assert isinstance(refused.value, Stopped)
        left = refused.value.run
        assert not left.complete
        assert len(left.time) == (31 if where == END else REACHED)
        for signal_name, values in left.signals.items():
            assert values.tobytes() == expected.signals[signal_name][: len(left.time)].tobytes()


@pytest.mark.parametrize("name", ["lets_nobody_write", "lets_nobody_open"])
def test_what_a_member_takes_away_from_its_process_stops_the_run_in_a_line(
    name, folder, lag, nothing_left
):
    with pytest.raises(Stopped) as refused:
        run(three(lag, build(name, folder)), TIME, {"u": np.ones(31)}, isolation=PATIENCE)
    assert str(refused.value).startswith("three: ")
    assert "\n" not in str(refused.value)
    left = refused.value.run
    assert len(left.time) >= REACHED
    np.testing.assert_allclose(left.signals["a.x"], response(len(left.time)), atol=1e-12)


def test_numbers_are_the_same_bits(lag, nothing_left):
    inputs = {"u": np.sin(TIME)}
    for model in (str(lag), "ppy_actuator"):
        given = inputs if model == str(lag) else {"current": np.sin(TIME)}
        here, there = (ppy.simulate(model, given, time=TIME, isolate=way) for way in (False, True))
        assert {k: v.tobytes() for k, v in here.outputs.items()} == {
            k: v.tobytes() for k, v in there.outputs.items()
        }


def test_what_the_fmu_refuses_is_told_in_its_words(lag):
    told = []
    for way in (False, True):
        with pytest.raises(UserError) as refused:
            ppy.simulate(str(lag), time=TIME, settings={"tau": 0.0}, isolate=way)
        told.append(str(refused.value))
    assert told[0] == told[1]
    assert "must be positive" in told[0]


COMMAND = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
from orchestration.cli.app import main
sys.exit(main())
"""


def command(*arguments, cwd):
    return subprocess.Popen(
        [sys.executable, "-c", COMMAND, *map(str, arguments)],
        cwd=cwd,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=os.environ | {"TMPDIR": str(cwd), "PYTHONPATH": os.pathsep.join(sys.path)},
    )


@pytest.mark.slow
def test_on_the_command_line_it_is_so_unless_told_otherwise(folder, tmp_path):
    bad = build("exits", folder)
    (tmp_path / "out.csv").write_text("dear\n")
    with command(
        "simulate",
        bad,
        "--set",
        "u=1",
        "--stop",
        "3s",
        "--step",
        "0.1s",
        "--out",
        "out.csv",
        cwd=tmp_path,
    ) as one:
        _, told = one.communicate(timeout=120)
    assert one.returncode == 2
    how = "step from 1 s: its process ended (exit status 0)"
    assert (
        told.splitlines()[-1]
        == f"error: exits.fmu: {how}; what was computed until 1 s is in out.part.csv"
    )
    assert (tmp_path / "out.csv").read_text() == "dear\n"
    part = read_record(tmp_path / "out.part.csv", {"x": ""})
    np.testing.assert_allclose(part.signals["x"], response(REACHED), atol=1e-9)


@pytest.fixture
def resting(folder, tmp_path, monkeypatch):
    """Start a simulation with these options, and return its process as soon as its FMU does not
    return any more.
    """
    sign = tmp_path / "rests"
    monkeypatch.setenv("PPY_TEST_RESTS", str(sign))

    def start(*options):
        run = (
            "simulate",
            build("sleeps", folder),
            "--set",
            "u=1",
            "--stop",
            "3s",
            "--step",
            "0.1s",
        )
        process = command(*run, *options, cwd=tmp_path)
        until = time.monotonic() + 60.0
        while not sign.exists() and process.poll() is None and time.monotonic() < until:
            time.sleep(0.05)
        assert sign.exists(), process.communicate(timeout=20)
        time.sleep(0.3)  # until whoever watches has seen that it goes on
        return process

    return start


@pytest.mark.slow
@pytest.mark.parametrize("presses", slow_but([1, 2], 1))
def test_ctrl_c_ends_a_hang(presses, resting, tmp_path):
    with resting() as one:
        begin = time.monotonic()
        for _ in range(presses):
            one.send_signal(signal.SIGINT)
            time.sleep(0.2)
        _, told = one.communicate(timeout=60)
    assert time.monotonic() - begin < 5.0
    assert one.returncode == 130
    assert told.splitlines()[-1] == "interrupted"
    assert [path for path in tmp_path.iterdir() if path.name.startswith("ppy-fmu")] == []


@pytest.mark.slow
def test_where_its_parent_is_killed_it_ends(resting):
    with resting() as one:
        found = [child.pid for child in psutil.Process(one.pid).children()]
        one.kill()
        one.communicate()
    assert found
    until = time.monotonic() + 20.0
    while any(alive(pid) for pid in found) and time.monotonic() < until:
        time.sleep(0.2)
    assert not any(alive(pid) for pid in found)


def alive(pid):
    return psutil.pid_exists(pid) and psutil.Process(pid).status() != psutil.STATUS_ZOMBIE


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "told"),
    [
        (
            ["--no-isolate", "--step-timeout", "3s"],
            "--step-timeout is for an FMU in a process of its own",
        ),
        (["--memory-limit", "much"], "'much': an amount of memory such as 2GB"),
        (["--memory-limit", "1KB"], "at least 256MB"),
        (["--step-timeout", "0s"], "a time above 0"),
    ],
)
def test_bad_limits_are_told_in_a_line(options, told, lag, tmp_path):
    with command("simulate", lag, "--set", "u=1", *options, cwd=tmp_path) as one:
        _, said = one.communicate(timeout=60)
    assert one.returncode == 2
    assert told in " ".join(said.split())


# ---- in this process
# -------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", ["exits", "exits_3", "exits_as_it_begins"])
def test_an_exit_in_process_does_not_look_like_success(name, folder, tmp_path):
    (tmp_path / "out.csv").write_text("dear\n")
    run = (
        "simulate",
        build(name, folder),
        "--set",
        "u=1",
        "--stop",
        "3s",
        "--step",
        "0.1s",
        "--out",
        "out.csv",
    )
    with command(*run, "--no-isolate", cwd=tmp_path) as one:
        _, told = one.communicate(timeout=120)
    assert one.returncode == 2
    assert (
        told.splitlines()[-1]
        == f"error: {name}.fmu: the FMU has ended this process; give --isolate"
    )
    assert (tmp_path / "out.csv").read_text() == "dear\n"


@pytest.mark.slow
def test_a_second_ctrl_c_ends_a_hang_in_process(resting):
    with resting("--no-isolate") as one:
        one.send_signal(signal.SIGINT)
        time.sleep(1.0)
        assert one.poll() is None, "nobody hears the first"
        one.send_signal(signal.SIGINT)
        _, told = one.communicate(timeout=20)
    assert one.returncode == 130
    assert told.splitlines()[-1] == "interrupted"


@pytest.mark.slow
def test_where_an_fmu_goes_to_the_result_does_not_follow(folder, tmp_path):
    run = (
        "simulate",
        build("changes_the_folder", folder),
        "--set",
        "u=1",
        "--stop",
        "3s",
        "--step",
        "0.1s",
    )
    with command(*run, "--no-isolate", "--out", "out.csv", cwd=tmp_path) as one:
        _, told = one.communicate(timeout=120)
    assert one.returncode == 0, told
    assert (tmp_path / "out.csv").exists()
