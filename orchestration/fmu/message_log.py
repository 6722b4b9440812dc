"""Log messages of FMUs, assigned to the instances that sent them.

fmpy expands the variable arguments of FMI's logger in a proxy that has one receiver for the whole
process. Therefore one permanent receiver is registered here; it finds the log of an instance by its
component environment.
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

from fmus.kit import quoting

# an FMU may send a message at every step
_MESSAGE_COUNT = 3
_MESSAGE_LENGTH = 1000  # characters


class MessageLog:
    """The last messages of one FMU instance with a status of warning or worse.

    Attributes
    ----------
    messages : deque of str
        Newest last, each in one line.
    callbacks : fmpy.fmi2.fmi2CallbackFunctions
        Callbacks for the instantiation; the FMU keeps a pointer to them.
    """

    def __init__(self) -> None:
        self.messages: deque[str] = deque(maxlen=_MESSAGE_COUNT)
        number = next(_numbers)
        self.callbacks = fmi2.fmi2CallbackFunctions()
        self.callbacks.logger = _RECEIVER
        self.callbacks.allocateMemory = fmi2.defaultCallbacks.allocateMemory
        self.callbacks.freeMemory = fmi2.defaultCallbacks.freeMemory
        self.callbacks.componentEnvironment = number
        # registers the receiver again: other code may have replaced it in fmpy's proxy
        addLoggerProxy(ctypes.byref(self.callbacks))
        _logs[number] = self

    def last(self, otherwise: str) -> str:
        """Return the last messages in one line, or `otherwise` without messages."""
        return "; ".join(self.messages) or otherwise


_logs: WeakValueDictionary[int, MessageLog] = WeakValueDictionary()
_numbers = itertools.count(1)


def _receive(environment: Any, name: bytes, status: int, category: bytes, message: bytes) -> None:
    """Log a message for its instance; print one of an instance that has no log."""
    log = _logs.get(environment or 0)
    if log is None:
        printLogMessage(environment, name, status, category, message)
    elif status not in (fmi2.fmi2OK, fmi2.fmi2Pending):
        text = message[: 4 * _MESSAGE_LENGTH].decode(errors="replace")[:_MESSAGE_LENGTH]
        log.messages.append(quoting.line(text))


_RECEIVER = fmi2.fmi2CallbackLoggerTYPE(_receive)
