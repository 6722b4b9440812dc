"""The command line as tests call it: a process of its own or this one, what it has to print, how it
has to refuse.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest

from demonstrations.emulator.emulator import EmulatedRig
from orchestration.cli import app
from orchestration.experiment.waveforms import multilevel
from orchestration.records import write_record

UNITS = {"current": "A", "force": "N", "voltage": "V", "displacement": "m"}
PNG = b"\x89PNG\r\n\x1a\n"
posix = pytest.mark.skipif(os.name == "nt", reason="signals and pipes as POSIX has them")


def ppy(
    *arguments: object, cwd: Path, environment: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run the command line in a process of its own, on no terminal."""
    command = [sys.executable, "-m", "orchestration.cli", *map(str, arguments)]
    return subprocess.run(
        command,
        cwd=cwd,
        capture_output=True,
        text=True,
        encoding="utf-8",
        stdin=subprocess.DEVNULL,
        timeout=240,
        env={**os.environ, "COLUMNS": "100", **(environment or {})},
    )


def recording(
    endpoint: str, stimulus: object, *more: object, out: str = "run.nc"
) -> tuple[object, ...]:
    """Return the arguments that record what a rig does."""
    return ("rig", "record", "--stimulus", stimulus, "--out", out, "--endpoint", endpoint, *more)


def running(
    *arguments: object, cwd: Path, before: Callable[[], None] | None = None
) -> subprocess.Popen[str]:
    """Start the command line in a process of its own, in which `before` is called first."""
    return subprocess.Popen(
        [sys.executable, "-m", "orchestration.cli", *map(str, arguments)],
        cwd=cwd,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=before,
    )


def works(*arguments: object, cwd: Path, environment: dict[str, str] | None = None) -> str:
    """Run the command line, here unless with an environment of its own, and return what it prints;
    it must succeed.
    """
    done = (
        here(*arguments, cwd=cwd)
        if environment is None
        else ppy(*arguments, cwd=cwd, environment=environment)
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert "\x1b" not in done.stdout + done.stderr  # no terminal codes in files
    return done.stdout


def on_terminal(
    *arguments: object, cwd: Path, interrupt_at: re.Pattern[str] | None = None
) -> tuple[int, str, str]:
    """Run the command line on a terminal, with ``cwd/scratch`` for temporary files.

    Parameters
    ----------
    *arguments
    cwd : Path
    interrupt_at : Pattern, optional
        SIGINT is sent as soon as this has been shown.

    Returns
    -------
    int, str, str
        Exit code, standard output, and what was shown on standard error.
    """
    import pty

    ours, theirs = pty.openpty()
    running = subprocess.Popen(
        [sys.executable, "-m", "orchestration.cli", *map(str, arguments)],
        cwd=cwd,
        stdout=subprocess.PIPE,
        stderr=theirs,
        text=True,
        env={k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "CI")}
        | {"TERM": "xterm", "COLUMNS": "120", "TMPDIR": str(cwd / "scratch")},
    )
    os.close(theirs)
    shown, sent = "", False
    while True:
        try:
            more = os.read(ours, 4096)
        except OSError:  # Linux: the other end is closed
            break
        if not more:
            break
        shown += re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", more.decode(errors="replace"))
        if interrupt_at is not None and not sent and interrupt_at.search(shown):
            running.send_signal(signal.SIGINT)
            sent = True
    os.close(ours)
    printed, _ = running.communicate(timeout=60)
    return running.returncode, printed, shown


def here(*arguments: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run the command line in this process; answers as `ppy` does."""
    command, before = ["ppy", *map(str, arguments)], (sys.argv, os.getcwd())
    hearing = signal.getsignal(signal.SIGINT)
    streams = [io.TextIOWrapper(io.BytesIO(), encoding="utf-8", newline="") for _ in range(2)]
    with (
        mock.patch.dict(os.environ, COLUMNS="100"),
        contextlib.redirect_stdout(streams[0]),
        contextlib.redirect_stderr(streams[1]),
    ):
        try:
            sys.argv = command
            os.chdir(cwd)
            app.main()
        except SystemExit as ended:
            code = ended.code
        finally:
            sys.argv = before[0]
            os.chdir(before[1])
            # an interrupted command has it ignored, and so would every process started from here
            signal.signal(signal.SIGINT, hearing)
    texts = []
    for stream in streams:
        stream.flush()
        texts.append(stream.buffer.getvalue().decode())
    assert isinstance(code, int)
    return subprocess.CompletedProcess(command, code, *texts)


def answered(*arguments: object, cwd: Path) -> Any:
    """Return what a command answers on standard output, where nothing else may be.

    The same must go into a file.
    """
    done = here(*arguments, "--json", "-", cwd=cwd)
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    done = here(*arguments, "--json", "answer.json", cwd=cwd)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "wrote answer.json"
    assert len(done.stdout.splitlines()) > 1
    assert json.loads((cwd / "answer.json").read_text(encoding="utf-8")) == answer
    return answer


def refused(folder, *arguments, parts=(), environment=None):
    """The command must fail as promised; returns its one line."""
    before = {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()}
    done = (
        here(*arguments, cwd=folder)
        if environment is None
        else ppy(*arguments, cwd=folder, environment=environment)
    )
    assert done.returncode == 2, (done.stdout, done.stderr)
    assert "Traceback" not in done.stderr
    lines = done.stderr.splitlines()
    errors = [line for line in lines if line.startswith("error: ")]
    assert errors == lines[-1:], done.stderr
    assert "internal error" not in errors[0]
    for part in parts:
        assert part in errors[0]
    assert {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()} == before
    return errors[0]


def measure(
    path: Path, rig: EmulatedRig, samples: int = 600, names: Sequence[str] = tuple(UNITS)
) -> Path:
    """Write a record of the emulated rig."""
    time = 0.1 * np.arange(samples)
    inputs = {
        "current": multilevel(time, [-0.9, 0.0, 0.9], (2.0, 8.0), 1),
        "force": multilevel(time, [0.5, 1.0, 2.75], (5.0, 12.0), 2),
    }
    signals = inputs | rig.run(time, **inputs)
    write_record(path, time, {name: signals[name] for name in names}, UNITS)
    return path
