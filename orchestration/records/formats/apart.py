"""Files that a parser in native code reads: in a process that a damaged one may end."""

from __future__ import annotations

import importlib
import os
import pickle
import signal
import subprocess
import sys
from pathlib import Path

from fmus.kit import UserError
from orchestration.records.record import refuse
from orchestration.records.tables import Reader, Table

# that a file may take at least: a busy machine with a cold disk is long at starting Python
_SECONDS = 60.0
_RATE = 1e7  # bytes that a reader gets through in a second
_MEMORY = 2**30  # bytes that a process needs at least
_GROWTH = 8  # further bytes for every byte of the file


def apart(reader: Reader) -> Reader:
    """Let another process read.

    Parameters
    ----------
    reader : Reader
        A function of a module.

    Returns
    -------
    Reader
        Refuses what ends that process, or takes too long.
    """

    def read(path: Path, content: bytes) -> Table:
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
            done = subprocess.run(
                command, input=content, capture_output=True, timeout=seconds, env=environment
            )
        except subprocess.TimeoutExpired:
            raise refuse(
                path, f"the file is damaged: to read it takes longer than {seconds:.0f} s"
            ) from None
        if done.returncode != 0:
            raise refuse(path, f"the file is damaged: its reader ended, {_how(done)}")
        answer = pickle.loads(done.stdout)
        if isinstance(answer, str):
            raise UserError(answer)
        assert isinstance(answer, Table)
        return answer

    read.__doc__ = reader.__doc__
    return read


def _how(done: subprocess.CompletedProcess[bytes]) -> str:
    if done.returncode < 0:
        return f"by {signal.Signals(-done.returncode).name}"
    last = done.stderr.decode(errors="replace").strip().splitlines()[-1:]
    return f"with status {done.returncode}" + (f": {last[0]}" if last else "")


def _bound_memory(file_size: int) -> None:
    """Limit this process to the memory that a sound file of a size takes; a lower limit stays."""
    try:
        import resource
    except ImportError:  # Windows has no such limit
        return
    allowed = _MEMORY + _GROWTH * file_size
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    if hard == resource.RLIM_INFINITY or hard > allowed:
        resource.setrlimit(resource.RLIMIT_AS, (allowed, hard))


def _main(module: str, name: str, path: str) -> None:
    answers = os.dup(1)
    os.dup2(2, 1)  # what a library prints, from here on, is no part of the answer
    content = sys.stdin.buffer.read()
    reader: Reader = getattr(importlib.import_module(module), name)
    _bound_memory(len(content))
    answer: Table | str
    try:
        answer = reader(Path(path), content)
    except UserError as error:
        answer = str(error)
    except MemoryError:
        answer = str(
            refuse(
                Path(path), "the file is damaged: it asks for more memory than it can hold values"
            )
        )
    with os.fdopen(answers, "wb") as file:
        file.write(pickle.dumps(answer))
    os._exit(
        0
    )  # a native library may abort when its threads are taken down, which is no fault of the file


if __name__ == "__main__":
    _main(*sys.argv[1:])
