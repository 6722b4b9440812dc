"""Log messages of FMUs, each to the instance it belongs to.

fmpy expands the variable arguments of FMI's logger in a proxy that knows one receiver for the whole process. So there
is one receiver here, which never goes away, and it tells instances apart by their component environment.
"""

from __future__ import annotations

import ctypes
import itertools
from collections import deque
from typing import Any
from weakref import WeakValueDictionary

import fmpy.fmi2 as fmi2
from fmpy.fmi1 import printLogMessage
from fmpy.logging import addLoggerProxy

_KEPT, _LONGEST = (
    3,
    1000,
)  # messages, and characters of one: an FMU may have something to say at every step


class MessageLog:
    """What one FMU instance said last: warnings and worse.

    Attributes
    ----------
    messages : deque of str
        Newest last, without characters that a terminal obeys.
    callbacks : fmpy.fmi2.fmi2CallbackFunctions
        To instantiate with; the FMU keeps a pointer to it.
    """

    def __init__(self) -> None:
        self.messages: deque[str] = deque(maxlen=_KEPT)
        self.callbacks = fmi2.fmi2CallbackFunctions()
        self.callbacks.logger = _RECEIVER
        self.callbacks.allocateMemory = fmi2.defaultCallbacks.allocateMemory
        self.callbacks.freeMemory = fmi2.defaultCallbacks.freeMemory
        self.callbacks.componentEnvironment = number = next(_numbers)
        # makes the one receiver the proxy's, also if somebody else took it in the meantime
        addLoggerProxy(ctypes.byref(self.callbacks))
        _logs[number] = self

    def last(self, otherwise: str) -> str:
        """Return the last messages in one line, or something else if there are none."""
        return "; ".join(self.messages) or otherwise


_logs: WeakValueDictionary[int, MessageLog] = WeakValueDictionary()
_numbers = itertools.count(1)


def _receive(environment: Any, name: bytes, status: int, category: bytes, message: bytes) -> None:
    log = _logs.get(environment or 0)
    if log is None:
        printLogMessage(environment, name, status, category, message)
    elif status not in (fmi2.fmi2OK, fmi2.fmi2Pending):
        text = message[: 4 * _LONGEST].decode(errors="replace")[:_LONGEST]
        log.messages.append(" ".join("".join(c if c.isprintable() else " " for c in text).split()))


_RECEIVER = fmi2.fmi2CallbackLoggerTYPE(_receive)
