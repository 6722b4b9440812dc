"""A fake instrument at the other end of a pseudo-terminal, which understands lines of text.

It takes ``CURR x`` with the reply ``OK``, and answers ``CURR?`` and ``TEMP?``.
"""

from __future__ import annotations

import os
import pty
import select
import threading
import tty
from collections.abc import Callable

CALIBRATION = r"""
[rig]
rate = 20.0
watchdog = 0.5

[instruments.supply]
resource = "{port}"
baudrate = 115200
timeout = 0.2
setup = ["CURR 0"]
termination = "\r\n"
answer = '([-+.\d]+) [AC]'
reply = "OK"

[inputs.current]
instrument = "supply"
write = "CURR {{volts:.6f}}"
query = "CURR?"
gain = 2.0
unit = "A"
range = [-1.2, 1.2]
safe = 0.1
date = 2026-11-29

[outputs.temperature]
instrument = "supply"
query = "TEMP?"
gain = 1.0
unit = "degC"
si = "K"
range = [-50.0, 200.0]
date = 2026-11-29

[limits.current]
min = -2.0
max = 2.0
"""


class Instrument:
    """The instrument, in a thread; a context manager.

    Attributes
    ----------
    port : str
        The end that a backend opens.
    current : float
    heard : list of str
        Every line that has arrived.
    answer : dict of str to bytes
        Other answers, by message; empty for none.
    """

    def __init__(self) -> None:
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self.current = 0.25
        self.heard: list[str] = []
        self.answer: dict[str, bytes] = {}
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Instrument:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._ends.set()
        self._thread.join()
        os.close(self._master)
        os.close(self._slave)

    def send(self, data: bytes) -> None:
        """Send bytes that nobody asked for."""
        os.write(self._master, data)

    def _run(self) -> None:
        waiting = b""
        while not self._ends.is_set():
            if not select.select([self._master], [], [], 0.02)[0]:
                continue
            waiting += os.read(self._master, 4096)
            *lines, waiting = waiting.split(b"\r\n")
            for line in lines:
                self.heard.append(line.decode())
                os.write(self._master, self.answer.get(line.decode(), self._answer(line.decode())))

    def _answer(self, line: str) -> bytes:
        answers: dict[str, Callable[[], str]] = {
            "CURR?": lambda: f"CURR {self.current:.6f} A",
            "TEMP?": lambda: "T1=+21.50 C, T2=+40.00 C",
        }
        if line in answers:
            return answers[line]().encode() + b"\r\n"
        name, _, number = line.partition(" ")
        if name != "CURR" or not -1.0 <= float(number) <= 1.0:
            return b"ERROR\r\n"
        self.current = float(number)
        return b"OK\r\n"
