"""Claims: the examples that the help of a command shows work as they stand.

Those that take a moment run on short records of an emulated rig under the names of `ppy demo`; all
of them, in order and on what `ppy demo` leaves, by `make test-slow`.
"""

from __future__ import annotations

import shlex
import signal
import subprocess
import sys
import time
import tomllib
from types import SimpleNamespace

import pytest

from demonstrations.emulator.emulator import EmulatedRig
from demonstrations.emulator.physics import RigParameters
from orchestration.cli.examples import EXAMPLES
from orchestration.rig.endpoint import read_endpoint
from orchestration.rig.operator import acknowledge, ask, stop
from orchestration.rig.server.log import EventLog
from orchestration.rig.tuning import tuning_socket
from tests.support.command import measure, works
from tests.support.rig.archived import filled, samples
from tests.support.rig.bench import FILE, served
from tests.support.rig.process import Server
from tests.support.rig.small_rig import free_port

QUICK = (
    "list",
    "info",
    "system export",
    "system list",
    "system show",
    "system draw",
    "system pack",
    "system check",
    "check",
    "sweep",
    "identify",
    "frequency",
)
LONG = ("compare", "design", "export modelica", "linearise", "optimise", "run", "simulate")
SERVED = ("rig stop", "rig status")
OF_A_RIG = tuple(command for command in EXAMPLES if command.startswith("rig "))
# all others need what these leave
FIRST = ("demo", "build", "system export")


def run(command, folder):
    for example in EXAMPLES[command]:
        works(*shlex.split(example)[1:], cwd=folder)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with what `ppy demo` and `ppy build` leave, made in a moment."""
    folder = tmp_path_factory.mktemp("quick")
    (folder / "demo-output").mkdir()
    rig = EmulatedRig(RigParameters(R1=0.6, C=2.0), seed=1)
    measure(folder / "demo-output" / "record.csv", rig)
    works("build", "ppy_actuator", "--runtime", "native", cwd=folder)
    return folder


@pytest.fixture(scope="module")
def exported(folder):
    """The same folder with a system."""
    run("system export", folder)
    return folder


@pytest.mark.parametrize("command", QUICK)
def test_examples_that_take_a_moment(folder, command):
    run(command, folder)


@pytest.mark.slow
@pytest.mark.parametrize("command", LONG)
def test_examples_that_take_longer(exported, command):
    run(command, exported)


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    """A folder with what the examples leave that all others need."""
    folder = tmp_path_factory.mktemp("whole")
    for command in FIRST:
        run(command, folder)
    return folder


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("command", [n for n in EXAMPLES if n not in (*FIRST, *OF_A_RIG)])
def test_all_examples_on_what_the_demonstration_leaves(demo, command):
    run(command, demo)


# --- a rig ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """A server at a port that is free, in the place of the usual one."""
    with Server(tmp_path_factory.mktemp("rig"), "emulator") as server:
        server.wait_ready()
        yield server


def release(rig):
    remote = read_endpoint(rig.endpoint)
    acknowledge(remote, ask(remote, "status")["latch"])


def run_at(rig, command, folder):
    for example in EXAMPLES[command]:
        run_one_at(rig.endpoint, example, folder)


def run_one_at(endpoint, example, folder, *more):
    return works(*shlex.split(example)[1:], "--endpoint", endpoint, *more, cwd=folder)


@pytest.mark.slow
@pytest.mark.parametrize("command", SERVED)
def test_examples_of_a_server(rig, tmp_path, command):
    run_at(rig, command, tmp_path)


@pytest.mark.slow
def test_a_latch_is_acknowledged_and_an_alarm_shelved(tmp_path):
    latch, shelve = EXAMPLES["rig acknowledge"]
    with served(tmp_path, volts=5.0) as endpoint:  # beyond the limit of warning
        remote = read_endpoint(endpoint)
        stop(remote, "an example")
        status = ask(remote, "status")
        (alarm,) = [one["name"] for one in status["alarms"] if one["source"] == "load"]
        # names in examples are made up: those that there are take their places
        run_one_at(endpoint, latch.replace("4820aeb249b43f32", status["latch"]), tmp_path)
        assert not ask(remote, "status")["latch"]
        run_one_at(endpoint, shelve.replace("1f6d727e", alarm), tmp_path)
        shelved = [one["source"] for one in ask(remote, "status")["alarms"] if one["shelved"]]
        assert shelved == ["load"]


@pytest.mark.slow
def test_a_sensor_is_adjusted(tmp_path):
    file = tmp_path / "bench.toml"
    earlier = ("--point", "-1=-1,1e-3,90")  # in place of what a dialog asks for
    added = (("--point", "2", *earlier), earlier)
    with served(tmp_path, volts=1.0) as endpoint:
        for example, points, gain in zip(EXAMPLES["rig calibrate"], added, (1.5, 4.5), strict=True):
            file.write_text(FILE)
            run_one_at(endpoint, example, tmp_path, *points)
            adjusted = tomllib.loads(file.read_text())["outputs"]["load"]
            assert adjusted["gain"] == pytest.approx(gain, rel=0.01)


@pytest.mark.slow
def test_a_log_is_checked_with_its_older_files(tmp_path):
    file = tmp_path / "rig.log"
    log = EventLog(file)
    for older in ("rig.log.2", "rig.log.1"):
        log.tell("ready")
        deadline = time.monotonic() + 10.0
        while not (file.exists() and " ready #" in file.read_text()):
            assert time.monotonic() < deadline
            time.sleep(0.01)
        file.rename(tmp_path / older)
    log.tell("ready")
    log.close()
    run("rig log", tmp_path)


@pytest.mark.slow
def test_a_run_is_tuned(tmp_path):
    numbers = {"value": 0.6, "target": 0.6, "min": 0.0, "max": None}
    state = {"bench.error_gain": {**numbers, "unit": "V/N", "doc": ""}}
    moves = []
    tuner = SimpleNamespace(state=lambda: state, move=lambda *move, by: str(moves.append(move)))
    with tuning_socket(tuner, 0, None) as address:
        for example in EXAMPLES["rig tune"]:
            works(*shlex.split(example)[1:], "--run", address, cwd=tmp_path)
    assert moves == [("bench.error_gain", 0.5, 0.02)]


@pytest.mark.slow
def test_keys_are_made(tmp_path):
    run("rig keys", tmp_path)
    assert (tmp_path / "keys" / "rig-server.toml").exists()


@pytest.mark.slow
def test_an_archive_is_listed_and_exported(tmp_path):
    filled(tmp_path / "archive", samples(range(1, 101)))
    run("rig archive", tmp_path)
    assert (tmp_path / "part.nc").exists()


@pytest.mark.slow
def test_a_server_starts(tmp_path):
    run("rig keys", tmp_path)
    for example in EXAMPLES["rig serve"]:
        arguments = example.removeprefix("ppy rig serve").split()
        with Server(tmp_path, "emulator", *arguments) as server:
            assert server.wait_ready().startswith("tcp://127.0.0.1:")


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 1])
def test_the_page_and_the_bridges_are_there_until_they_are_interrupted(rig, tmp_path, number):
    works("rig", "keys", "keys", cwd=tmp_path)
    (tmp_path / "key.toml").write_bytes((tmp_path / "keys" / "rig-client.toml").read_bytes())
    watch = f"{EXAMPLES['rig watch'][number]} --endpoint {rig.endpoint} --port 0 --no-browser"
    bridge = EXAMPLES["rig bridge"][number].replace("tcp://rig:5570", "tcp://127.0.0.1:9")
    bridge += f" --port {free_port()}"
    opcua = f"{EXAMPLES['rig opcua'][number]} --endpoint {rig.endpoint} --port {free_port()}"
    signs = ((watch, "watching"), (bridge, "is carried on to"), (opcua, "ready: opc.tcp://"))
    for example, sign in signs:
        with started(example, tmp_path) as process:
            assert sign in process.stdout.readline()
            process.send_signal(signal.SIGINT)
            assert process.wait(30) in (0, 130)


def started(example, folder):
    command = [sys.executable, "-u", "-m", "orchestration.cli", *shlex.split(example)[1:]]
    return subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True)


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_rig_is_commissioned(tmp_path):
    run("rig commission", tmp_path)
    assert "PASS" in (tmp_path / "rig.html").read_text().upper()


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_examples_of_a_rig_that_take_long(rig, tmp_path):
    release(rig)
    run_at(rig, "rig record", tmp_path)
    run("rig demo", tmp_path)


@pytest.mark.slow
def test_every_example_is_run_by_one_of_these():
    named = {"rig keys", "rig serve", "rig watch", "rig bridge", "rig opcua", "rig record"}
    named |= {
        "rig tune",
        "rig archive",
        "rig acknowledge",
        "rig calibrate",
        "rig log",
        "rig commission",
    }
    assert set(OF_A_RIG) == {*SERVED, *named, "rig demo"}
