"""Claims: the examples that the help of a command shows work as they stand.

Those that take a moment run on short records of an emulated rig under the names of `ppy demo`; all
of them, in order and on what `ppy demo` leaves, by `make test-slow`.
"""

from __future__ import annotations

import shlex
import signal
import subprocess
import sys

import pytest

from demonstrations.emulator.emulator import EmulatedRig
from demonstrations.emulator.physics import RigParameters
from orchestration.cli.examples import EXAMPLES
from orchestration.rig.endpoint import read_endpoint
from orchestration.rig.operator import acknowledge, ask
from tests.support.command import measure, works
from tests.support.rig.archived import filled, samples
from tests.support.rig.process import Server
from tests.support.rig.small_rig import free_port

QUICK = (
    "list",
    "info",
    "system export",
    "system list",
    "system show",
    "system draw",
    "system check",
    "check",
    "sweep",
    "identify",
    "frequency",
)
LONG = ("compare", "export modelica", "linearise", "optimise", "run", "simulate")
SERVED = ("rig stop", "rig acknowledge", "rig status")
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
        works(*shlex.split(example)[1:], "--endpoint", rig.endpoint, cwd=folder)


@pytest.mark.slow
@pytest.mark.parametrize("command", SERVED)
def test_examples_of_a_server(rig, tmp_path, command):
    if command == "rig acknowledge":  # the latch of an example is none that there is
        release(rig)
    run_at(rig, command, tmp_path)


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
@pytest.mark.timeout(1800)
def test_examples_of_a_rig_that_take_long(rig, tmp_path):
    release(rig)
    run_at(rig, "rig record", tmp_path)
    run("rig demo", tmp_path)


@pytest.mark.slow
def test_every_example_is_run_by_one_of_these():
    named = {"rig keys", "rig serve", "rig watch", "rig bridge", "rig opcua", "rig record"}
    named |= {"rig archive"}
    assert set(OF_A_RIG) == {*SERVED, *named, "rig demo"}
