"""The process beside: it is told functions and their arguments, one after the other, and tells what they return."""

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

from fmus.kit.errors import UserError
from orchestration.fmu.isolation import box
from orchestration.fmu.isolation.frames import receive, send

_PATIENCE = 5.0  # s that a call has to end when whoever wanted it is gone


def main() -> None:
    """Serve until standard input ends; the folder and the limit of memory in bytes are the arguments."""
    folder, memory = Path(sys.argv[1]), int(sys.argv[2])
    asked, answers = _own_channel()
    signal.signal(
        signal.SIGINT, signal.default_int_handler
    )  # whatever it was for whoever started this
    _limit(memory)
    tempfile.tempdir = str(folder)
    box.current = box.Box(folder)
    orders: SimpleQueue[Any] = SimpleQueue()
    threading.Thread(target=_listen, args=(asked, orders), daemon=True).start()
    while True:
        try:
            order = orders.get()
            if order is None:
                return
            _serve(order, answers)
        except KeyboardInterrupt:
            continue  # it came when all was done


def _own_channel() -> tuple[BinaryIO, BinaryIO]:
    """Take the standard streams for ourselves: what FMUs print goes to the standard error, and they read nothing."""
    asked, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.dup2(2, 1)
    return asked, answers


def _limit(memory: int) -> None:
    with suppress(ImportError, ValueError, OSError):  # not on every platform
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        if memory:
            resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))


def _listen(asked: BinaryIO, orders: SimpleQueue[Any]) -> None:
    while (order := receive(asked)) is not None:
        if order == "interrupt":
            signal.raise_signal(signal.SIGINT)
        else:
            orders.put(order)
    orders.put(None)
    threading.Event().wait(_PATIENCE)
    os._exit(1)


def _serve(order: Any, answers: BinaryIO) -> None:
    function, arguments, names = order

    def tell(name: str) -> Any:
        return lambda *given: send(answers, ("told", name, given))

    try:
        answer = ("result", function(*arguments, **{name: tell(name) for name in names}))
    except UserError as error:
        answer = ("refused", error)
    except KeyboardInterrupt:
        answer = ("interrupted", None)
    except MemoryError:
        answer = ("refused", UserError("out of memory"))
    except Exception as error:
        answer = ("failed", error)
    try:
        send(answers, answer)
    except (pickle.PicklingError, TypeError, AttributeError) as error:
        send(answers, ("failed", RuntimeError(f"{type(error).__name__}: {error}")))
