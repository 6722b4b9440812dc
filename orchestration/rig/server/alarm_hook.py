"""Hook that tells a program or a web address of each alarm, once, in a bounded time."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable, Mapping
from contextlib import suppress
from queue import Full, Queue
from threading import Thread
from typing import Any
from urllib.request import Request, urlopen

from orchestration.rig.server.scheduling import go_without_priority

_LONGEST = 10.0  # s that a program or an address may take
_MOST = 100  # alarms that wait for those before them


class AlarmHook:
    """Thread that calls a program with an alarm as JSON, or posts it to an address.

    Parameters
    ----------
    target : str
        Path of the program, or address that begins with ``http://`` or ``https://``.
    tell : callable
        Called with a line about each call that fails.
    """

    def __init__(self, target: str, tell: Callable[[str], None]) -> None:
        self._target = target
        self._tell = tell
        self._alarms: Queue[str] = Queue(_MOST)
        Thread(target=self._run, daemon=True, name="alarm hook").start()

    def announce(self, fields: Mapping[str, Any]) -> None:
        """Have the thread tell of an alarm; it is lost if too many wait."""
        with suppress(Full):
            self._alarms.put_nowait(json.dumps(fields))

    def _run(self) -> None:
        go_without_priority()
        while True:
            alarm = self._alarms.get()
            try:
                self._call(alarm)
            except Exception as error:  # a program or a server of somebody else
                self._tell(f"--alarm-hook {self._target}: {error}")

    def _call(self, alarm: str) -> None:
        if self._target.startswith(("http://", "https://")):
            kind = {"Content-Type": "application/json"}
            with urlopen(Request(self._target, alarm.encode(), kind), timeout=_LONGEST):
                return
        subprocess.run(
            [self._target, alarm], stdin=subprocess.DEVNULL, timeout=_LONGEST, check=True
        )
