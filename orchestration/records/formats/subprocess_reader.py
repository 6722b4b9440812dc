"""Readers in a subprocess, for parsers in native code that a damaged file may crash."""

from __future__ import annotations

import importlib
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fmus.kit import UserError
from orchestration.records.record import refuse
from orchestration.records.tables import Table

_SECONDS = 60.0  # a busy machine with a cold disk takes long to start Python
_RATE = 1e7  # bytes that a reader parses per second at least
_MEMORY = 2**30  # bytes that a process needs at least
_GROWTH = 8  # further bytes for every byte of the file


def in_subprocess(reader: Callable[..., Table]) -> Callable[..., Table]:
    """Return a reader that runs another one in a subprocess of limited time and memory.

    Parameters
    ----------
    reader : callable
        A function at the top level of a module.

    Returns
    -------
    callable
        It refuses a file that crashes the subprocess, or takes too much time or memory.
    """

    def read(path: Path, content: bytes, *more: Any) -> Table:
        command = [
            sys.executable,
            "-P",
            "-m",
            __name__,
            reader.__module__,
            reader.__name__,
            str(path),
        ]
        seconds = _SECONDS + len(content) / _RATE
        # memory is reserved for each thread
        environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
        try:
            process = subprocess.run(
                command,
                input=pickle.dumps((content, more)),
                capture_output=True,
                timeout=seconds,
                env=environment,
            )
        except subprocess.TimeoutExpired:
            raise refuse(
                path, f"the file is damaged: to read it takes longer than {seconds:.0f} s"
            ) from None
        if process.returncode != 0:
            raise refuse(path, f"the file is damaged: its reader ended, {_cause(process)}")
        answer = pickle.loads(process.stdout)
        if isinstance(answer, str):
            raise UserError(answer)
        assert isinstance(answer, Table)
        return answer

    return read


def _cause(process: subprocess.CompletedProcess[bytes]) -> str:
    """Return the signal that ended a process, or its status and its last message."""
    if process.returncode < 0:
        return f"by {signal.Signals(-process.returncode).name}"
    last = process.stderr.decode(errors="replace").strip().splitlines()[-1:]
    return f"with status {process.returncode}" + (f": {last[0]}" if last else "")


def _bound_memory(file_size: int) -> None:
    """Limit the memory of this process to the needs of an intact file of that size."""
    try:
        import resource
    except ImportError:  # Windows has no such limit
        return
    allowed = _MEMORY + _GROWTH * file_size
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    if hard == resource.RLIM_INFINITY or hard > allowed:
        resource.setrlimit(resource.RLIMIT_AS, (allowed, hard))


def _main(module: str, name: str, path: str) -> None:
    """Run a reader on standard input, and write its table or error to standard output."""
    output = os.dup(1)
    os.dup2(2, 1)  # libraries may print, which must not mix with the answer
    content, more = pickle.load(sys.stdin.buffer)
    reader: Any = getattr(importlib.import_module(module), name)
    _bound_memory(len(content))
    answer: Table | str
    try:
        answer = reader(Path(path), content, *more)
    except UserError as error:
        answer = str(error)
    except MemoryError:
        answer = str(
            refuse(
                Path(path),
                "the file is damaged: reading it takes more memory than its size explains",
            )
        )
    with os.fdopen(output, "wb") as file:
        file.write(pickle.dumps(answer))
    # a native library may abort when its threads end, which is no fault of the file
    os._exit(0)


if __name__ == "__main__":
    _main(*sys.argv[1:])
