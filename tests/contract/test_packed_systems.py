"""The contract for a system in one FMU, line by line, where it is not about laws of a component."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from fmus.kit.build.toolchain import host_platform
from orchestration import master
from orchestration.system import library
from tests.contract import checks, hostile, leaks, structure
from tests.contract.raw import ERROR
from tests.contract.subjects import Subject
from tests.support import hosts

pytestmark = pytest.mark.slow
CYCLES = 200
SUBJECT = Subject(
    inputs={"force_reference": 1.0, "current": 0.5},
    output="tension",
    parameters={"actuator.k1": 5000.0, "actuator.R1": 0.5, "actuator.C": 3.0},
    signals="",
    started={},
)
CHECKS: list[Callable[[Path], None]] = [
    checks.library_knows_the_guid_of_the_description,
    checks.no_time_and_no_order_of_this_machine,
    checks.going_on_from_a_saved_state_gives_the_same_bits,
    checks.a_state_may_be_restored_anywhere,
    checks.every_bound_of_every_parameter_holds,
    structure.every_unknown_is_listed,
]


@pytest.fixture(scope="module")
def bench(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("packed") / "dma_bench.fmu"
    path.write_bytes(master.pack(library.system("dma_bench"), [host_platform()]))
    return path


@pytest.mark.parametrize("holds", CHECKS, ids=lambda check: check.__name__)
def test_what_holds_of_every_fmu(bench, holds):
    holds(bench)


def test_two_builds_are_the_same_bytes(bench):
    assert master.pack(library.system("dma_bench"), [host_platform()]) == bench.read_bytes()


@pytest.mark.parametrize("spoil", [checks.stepping, checks.terminated])
def test_reset_then_run_is_a_fresh_run(bench, spoil):
    checks.reset_then_run_is_a_fresh_run(bench, SUBJECT, spoil)


def test_whatever_a_host_does_the_answer_is_a_sentence(bench):
    finished = hosts.finish_in_subprocess(hostile.play, str(bench), SUBJECT)
    assert finished.returncode == 0, finished.output
    for case, pattern in hostile.EXPECTED.items():
        statuses, messages, _ = finished.result[case]
        told = re.sub(r"<(\w+)>", lambda role: getattr(SUBJECT, role[1]), pattern)
        assert case == "enormous_input" or set(statuses) == {ERROR}, case
        assert case == "enormous_input" or re.search(told, messages[0]), (case, messages)


@pytest.mark.skipif(sys.platform != "linux", reason="memory is counted on Linux")
def test_instances_and_steps_leak_nothing(bench):
    returncode, grown = hosts.in_subprocess(leaks.grow_by_creating, str(bench), CYCLES)
    assert returncode == 0, grown
    assert grown < 0.5 * CYCLES * leaks.LEAST
    returncode, answer = hosts.in_subprocess(leaks.grow_by_stepping, str(bench), SUBJECT, 1_000)
    assert returncode == 0, answer
    assert answer[0] < 0.5 * 1_000 * leaks.LEAST
