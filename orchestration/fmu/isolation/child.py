"""The main program of an isolated process: it calls the functions it receives, one by one."""

from __future__ import annotations

import os
import pickle
import signal
import sys
import tempfile
import threading
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from typing import Any, BinaryIO

from fmus.kit import UserError
from orchestration.fmu.isolation import shared_progress
from orchestration.fmu.isolation.messages import receive, send

_GRACE = 5.0  # s that a call may go on after the parent process has gone


def main() -> None:
    """Serve until standard input ends.

    The command line arguments are the folder and the limit of memory in bytes.
    """
    folder = Path(sys.argv[1])
    memory = int(sys.argv[2])
    requests, replies = _take_standard_streams()
    # whatever the handler was in the process that started this one
    signal.signal(signal.SIGINT, signal.default_int_handler)
    _limit_memory(memory)
    tempfile.tempdir = str(folder)
    shared_progress.current = shared_progress.SharedProgress(folder)
    queue: SimpleQueue[Any] = SimpleQueue()
    threading.Thread(target=_listen, args=(requests, queue), daemon=True).start()
    while True:
        try:
            request = queue.get()
            if request is None:
                return
            _serve(request, replies)
        except KeyboardInterrupt:
            continue  # it came after the last call had ended


def _take_standard_streams() -> tuple[BinaryIO, BinaryIO]:
    """Reserve the standard streams for messages: FMUs print to standard error and read nothing."""
    requests = os.fdopen(os.dup(0), "rb")
    replies = os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.dup2(2, 1)
    return requests, replies


def _limit_memory(memory: int) -> None:
    with suppress(ImportError, ValueError, OSError):  # not on every platform
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        if memory:
            resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))


def _listen(requests: BinaryIO, queue: SimpleQueue[Any]) -> None:
    while (request := receive(requests)) is not None:
        if request == "interrupt":
            signal.raise_signal(signal.SIGINT)
        else:
            queue.put(request)
    queue.put(None)
    threading.Event().wait(_GRACE)
    os._exit(1)


def _serve(request: Any, replies: BinaryIO) -> None:
    """Call a function and send its result; calls of its callbacks are sent as they are made."""
    function, arguments, callback_names = request

    def sender(name: str) -> Any:
        return lambda *values: send(replies, ("callback", name, values))

    callbacks = {name: sender(name) for name in callback_names}
    try:
        reply = ("result", function(*arguments, **callbacks))
    except UserError as error:
        reply = ("refused", error)
    except KeyboardInterrupt:
        reply = ("interrupted", None)
    except MemoryError:
        reply = ("refused", UserError("out of memory"))
    except Exception as error:
        reply = ("failed", error)
    try:
        send(replies, reply)
    except (pickle.PicklingError, TypeError, AttributeError) as error:
        send(replies, ("failed", RuntimeError(f"{type(error).__name__}: {error}")))
