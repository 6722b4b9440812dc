"""Programs that are given a time; what they started ends with them."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Sequence


def run(command: Sequence[str], limit: float) -> subprocess.CompletedProcess[str]:
    """Run a program that reads nothing, and wait for it.

    Parameters
    ----------
    command : sequence of str
    limit : float
        s.

    Returns
    -------
    subprocess.CompletedProcess
        With what it printed.

    Raises
    ------
    OSError
        If it cannot be started.
    subprocess.TimeoutExpired
        If it is not done in time. As after an interrupt, nothing that it started runs on.
    """
    nothing, pipe = subprocess.DEVNULL, subprocess.PIPE
    # a group of its own can be ended as a whole; Ctrl-C, which it does not hear then, ends it here
    with subprocess.Popen(
        command,
        stdin=nothing,
        stdout=pipe,
        stderr=pipe,
        text=True,
        errors="replace",
        start_new_session=True,
    ) as process:
        try:
            printed, told = process.communicate(timeout=limit)
        except BaseException:
            _end(process)
            raise
    return subprocess.CompletedProcess(command, process.returncode, printed, told)


def _end(process: subprocess.Popen[str]) -> None:
    if sys.platform == "win32":
        subprocess.run(["taskkill", "/F", "/T", "/PID", str(process.pid)], capture_output=True)
        process.kill()
    else:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    process.wait()
