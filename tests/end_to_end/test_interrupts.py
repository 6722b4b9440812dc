"""Claims: Ctrl-C ends a command whenever it is pressed, also while CasADi makes expressions of its
laws; a package of Modelica is there whole or not at all.
"""

from __future__ import annotations

import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
import traceback
from collections import Counter

import casadi as ca
import psutil
import pytest

from demonstrations.emulator.emulator import EmulatedRig
from demonstrations.records import draw, write
from tests.support.command import measure, posix, works

TRIES = 15
START = "from orchestration.cli.__main__ import main; print(flush=True); main()"
EXPORT = ["export", "modelica", "pid", "galvanostat"]


def started(arguments, folder):
    """Start a command as its script does, and return when it begins."""
    process = subprocess.Popen(
        [sys.executable, "-c", START, *arguments],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stdout.readline() == "\n"
    return process


def used(process):
    """Return the seconds that a process has computed, whatever else its machine does."""
    times = psutil.Process(process.pid).cpu_times()
    return times.user + times.system


def moments(arguments, folder):
    """Draw moments of a command, by the seconds it has computed; none is within its way out."""
    begins, ends = [], []
    for k in range(3):  # the first time it fills caches
        place = folder / str(k)
        place.mkdir()
        with started(arguments, place) as process:
            begins.append(used(process))
            ends.append(begins[-1])
            while process.poll() is None:
                ends[-1] = used(process)
                time.sleep(0.01)
        assert process.returncode == 0
    draw = random.Random(arguments[0])
    return [draw.uniform(max(begins), 0.7 * min(ends)) for _ in range(TRIES)]


@posix
@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize(
    "arguments",
    [["export", "modelica"], ["-q", "linearise", "foot_free"]],
    ids=["export", "linearise"],
)
def test_ctrl_c_at_any_moment_ends_a_command(arguments, tmp_path):
    ends = Counter()
    for moment in moments(arguments, tmp_path):
        with started(arguments, tmp_path) as process:
            while used(process) < moment and process.poll() is None:
                time.sleep(0.002)
            process.send_signal(signal.SIGINT)
            _, told = process.communicate(timeout=120)
        ends[process.returncode, told] += 1
    assert ends == {(130, "interrupted\n"): TRIES}


@posix
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT], ids=["kill", "Ctrl-C"])
def test_a_package_is_there_whole_or_not_at_all(number, tmp_path):
    works(*EXPORT, "--out", "whole", cwd=tmp_path)
    with started(EXPORT, tmp_path) as process:
        while not any((tmp_path / "modelica").rglob("*.mo")):
            time.sleep(0.0005)
        process.send_signal(number)
        _, told = process.communicate(timeout=60)
    assert (process.returncode, told) in [(-signal.SIGKILL, ""), (130, "interrupted\n")]
    package = tmp_path / "modelica" / "PpyRig"
    if number == signal.SIGINT:
        assert {p.name for p in (tmp_path / "modelica").iterdir()} <= {"PpyRig"}
    if not package.exists():
        works(*EXPORT, cwd=tmp_path)
    contents = [
        {p.relative_to(top): p.read_bytes() for p in top.rglob("*.*")}
        for top in (package, tmp_path / "whole" / "PpyRig")
    ]
    assert contents[0] == contents[1]


@pytest.fixture
def operators(monkeypatch):
    """Places that called operators of CasADi: those that lose a Ctrl-C, and those that do not."""
    plain = ca.DM_from_array
    called = {True: [], False: []}

    def watched(*arguments):
        hears = threading.current_thread() is threading.main_thread()
        lost = hears and signal.getsignal(signal.SIGINT) is signal.default_int_handler
        where = [f"{f.filename}:{f.lineno}" for f in traceback.extract_stack(limit=4)[:-1]]
        called[lost].append(where if lost else [])
        return plain(*arguments)

    monkeypatch.setattr(ca, "DM_from_array", watched)
    return called


@pytest.mark.parametrize(
    "arguments",
    [
        EXPORT,
        [*EXPORT, "--fmus"],
        ["linearise", "ppy_actuator", "--trim"],
        pytest.param(["linearise", "work_loop"], marks=pytest.mark.slow),
        pytest.param(["laws", "record.csv"], marks=pytest.mark.slow),
        pytest.param(["diagnose", "record.csv"], marks=pytest.mark.slow),
    ],
    ids=" ".join,
)
def test_no_operator_is_called_where_it_would_lose_ctrl_c(arguments, operators, tmp_path):
    if "record.csv" in arguments:
        measure(tmp_path / "record.csv", EmulatedRig())
    works(*arguments, cwd=tmp_path)
    assert operators[True] == []
    assert operators[False]


def test_where_an_operator_would_lose_it_is_seen(operators):
    assert str(ca.SX.sym("x") * 2.0) == "(2.*x)"
    assert __file__ in operators[True][0][-2]


@posix
@pytest.mark.slow
def test_ctrl_c_in_a_search_leaves_the_best_answer_so_far(tmp_path):
    write(draw("strain_saturation", 1, duration=120.0), tmp_path / "record.csv")
    arguments = ["diagnose", "record.csv", "--json", "so_far.json", "--report", "page.html"]
    process = started(arguments, tmp_path)
    assert any("terms along" in line for line in process.stderr)
    process.send_signal(signal.SIGINT)
    shown, told = process.communicate(timeout=100)
    assert process.returncode == 130
    assert told.splitlines()[-1] == "interrupted: this was the best answer so far"
    assert "Ctrl-C was pressed: this is the best answer so far" in shown
    kept = json.loads((tmp_path / "so_far.json").read_text("utf-8"))
    assert kept["verdict"] in ("recalibrate", "cause", "ambiguous", "unexplained")
    assert (tmp_path / "page.html").exists()


@posix
@pytest.mark.slow
def test_ctrl_c_among_several_records_leaves_those_that_are_done(tmp_path):
    for name, duration in (("a", 30.0), ("b", 600.0), ("c", 600.0)):
        write(draw("strain_saturation", 1, duration=duration), tmp_path / f"{name}.csv")
    names = [f"{name}.csv" for name in "abc"]
    arguments = ["diagnose", *names, "--workers", "2", "--json", "done.json"]
    process = started(arguments, tmp_path)
    assert any("1 of 3 records" in line for line in process.stderr)
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=100)
    assert process.returncode == 130
    assert told.splitlines()[-1] == "interrupted: 2 of 3 records were not diagnosed"
    kept = json.loads((tmp_path / "done.json").read_text("utf-8"))["figures"]
    assert ([*kept["records"]], kept["missing"]) == (["a.csv"], ["b.csv", "c.csv"])


SWEPT = """
import ppy_rig as ppy
over = {"R1": "0.3..0.7:400"}
ppy.sweep("ppy_actuator", over, {"current": 0.5}, stop=100.0, step=0.1, engine="fmu")
"""


@posix
@pytest.mark.slow
@pytest.mark.parametrize("is_terminal", [True, False])
def test_python_shows_a_bar_on_a_terminal_and_nothing_elsewhere(is_terminal, tmp_path):
    own, others = os.openpty() if is_terminal else os.pipe()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "120"}
    with subprocess.Popen(
        [sys.executable, "-c", SWEPT], cwd=tmp_path, stderr=others, env=environment
    ) as process:
        os.close(others)
        told = b""
        with contextlib.suppress(OSError):  # Linux's way to say that a terminal is closed
            while part := os.read(own, 4096):
                told += part
    os.close(own)
    assert process.returncode == 0, told
    assert (b"sweep" in told) is (b"of 400" in told) is is_terminal
    assert is_terminal or not told
