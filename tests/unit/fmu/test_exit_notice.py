"""Claims: an exit by C code while an FMU is open is a failure with a message; any other exit is
none.
"""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.support.command import posix

pytestmark = posix
PROGRAM = """
import ctypes
from orchestration.fmu.exit_notice import note_closed, note_opened
for name in {opened!r}:
    note_opened(name)
for name in {closed!r}:
    note_closed(name)
{end}
"""
C_EXIT = "ctypes.CDLL(None).exit(0)"
NOTICE = "the FMU has ended this process; give isolate=True"
LONG = f"{'a' * 600}.fmu"
ROOM = 499  # bytes of a notice in C, whose array of 500 ends in a zero


@pytest.mark.parametrize(
    ("opened", "closed", "end", "status", "message"),
    [
        (["a.fmu"], [], C_EXIT, 2, f"error: a.fmu: {NOTICE}\n"),
        (["b.fmu", "a.fmu", "c.fmu"], ["c.fmu"], C_EXIT, 2, f"error: a.fmu, b.fmu: {NOTICE}\n"),
        (["a.fmu", "a.fmu"], ["a.fmu"], C_EXIT, 2, f"error: a.fmu: {NOTICE}\n"),
        ([LONG], [], C_EXIT, 2, f"error: {LONG}"[:ROOM]),
        (["a.fmu"], ["a.fmu"], C_EXIT, 0, ""),
        (["a.fmu"], [], "", 0, ""),
        (["a.fmu"], [], "raise SystemExit(3)", 3, ""),
    ],
)
def test_only_an_exit_by_c_code_while_an_fmu_is_open_is_noticed(
    opened, closed, end, status, message
):
    program = PROGRAM.format(opened=opened, closed=closed, end=end)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (status, message)
