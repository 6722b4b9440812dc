"""Main program of an isolated process, which calls the functions that it receives one by one."""

from __future__ import annotations

import os
import pickle
import signal
import sys
import tempfile
import threading
from contextlib import AbstractContextManager, ExitStack, suppress
from pathlib import Path
from queue import SimpleQueue
from typing import Any, BinaryIO, TypeVar

from fmus.kit import UserError
from orchestration.fmu.isolation import shared_progress
from orchestration.fmu.isolation.messages import receive, send

_GRACE = 5.0  # s that a call may go on after the parent process has gone
_kept = ExitStack()  # contexts that stay open from call to call
Context = TypeVar("Context")


def keep(context: AbstractContextManager[Context]) -> Context:
    """Enter a context of this process, such as an open FMU, until `release`."""
    return _kept.enter_context(context)


def release() -> None:
    """Exit the contexts that were kept."""
    _kept.close()


def main() -> None:
    """Call the functions received on standard input until it ends.

    Command line arguments are the folder and the memory limit in bytes, 0 for none.
    """
    folder = Path(sys.argv[1])
    memory = int(sys.argv[2])
    requests, replies = _take_standard_streams()
    # the parent may ignore the signal, which a child inherits
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
            continue  # Ctrl-C after the end of the last call


def _take_standard_streams() -> tuple[BinaryIO, BinaryIO]:
    """Return copies of the standard streams; FMUs read nothing and print to standard error."""
    requests = os.fdopen(os.dup(0), "rb")
    replies = os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.dup2(2, 1)
    return requests, replies


def _limit_memory(memory: int) -> None:
    """Limit the data of this process to a number of bytes, 0 for no limit; write no core dump."""
    with suppress(ImportError, ValueError, OSError):  # not supported on every platform
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        if memory:
            resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))


def _listen(requests: BinaryIO, queue: SimpleQueue[Any]) -> None:
    """Queue requests, raise Ctrl-C when one says so, and exit after the end of the stream."""
    while (request := receive(requests)) is not None:
        if request == "interrupt":
            signal.raise_signal(signal.SIGINT)
        else:
            queue.put(request)
    queue.put(None)
    threading.Event().wait(_GRACE)
    os._exit(1)


def _serve(request: Any, replies: BinaryIO) -> None:
    """Call a function, send the calls of its callbacks, and then its result."""
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
