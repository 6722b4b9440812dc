"""A terminal in whose foreground a command runs, as a job of its own, as a shell starts it.

As a program it stands for the shell: ``terminal.py TERMINAL COMMAND ...``.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import pty
import select
import signal
import subprocess
import sys
import termios
import threading
from collections.abc import Sequence

KEYS = {"SIGINT": b"\x03", "SIGQUIT": b"\x1c", "SIGTSTP": b"\x1a"}
HOLD = b"\x13"  # Ctrl-S: whoever prints waits


class Terminal:
    """A pseudo-terminal: keys are pressed, what is printed is thrown away, and it can be closed.

    Attributes
    ----------
    screen : int
        File descriptor for the command.
    """

    def __init__(self) -> None:
        self._keyboard, self.screen = pty.openpty()
        self._name = os.ttyname(self.screen)
        self._closing = threading.Event()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        # a read that waits would keep the terminal from being closed
        while not self._closing.wait(0.01):
            if select.select([self._keyboard], [], [], 0)[0]:
                os.read(self._keyboard, 65536)

    def command(self, command: Sequence[str]) -> list[str]:
        """Return the command that runs another one in the foreground; it needs a new session."""
        return [sys.executable, "-S", "-E", __file__, self._name, *command]

    def press(self, keys: bytes) -> None:
        """Type."""
        os.write(self._keyboard, keys)

    def send(self, number: signal.Signals) -> None:
        """Send the foreground a signal: by its key, by closing the terminal, or by its group."""
        if number.name in KEYS:
            self.press(KEYS[number.name])
        elif number == signal.SIGHUP:
            self.close()
        else:
            group = os.tcgetpgrp(self._keyboard)
            if group < 1:  # nobody is there; a signal to group 0 would come to ourselves
                raise ProcessLookupError
            os.killpg(group, number)

    def close(self) -> None:
        """Hang up, as when the window is closed."""
        self._closing.set()
        self._reader.join()
        for descriptor in (self.screen, self._keyboard):
            with contextlib.suppress(OSError):
                os.close(descriptor)


def _work_as_shell(terminal: str, command: Sequence[str]) -> int:
    """Run a command in the foreground until it ends; take the terminal back if it is stopped."""
    for number in (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT):
        signal.signal(number, signal.SIG_DFL)  # whoever tests may have been started to ignore them
    screen = os.open(terminal, os.O_RDWR)
    fcntl.ioctl(screen, termios.TIOCSCTTY, 0)
    job = subprocess.Popen(command, process_group=0)
    signal.signal(signal.SIGTTOU, signal.SIG_IGN)
    os.tcsetpgrp(screen, job.pid)
    while True:
        _, status = os.waitpid(job.pid, os.WUNTRACED)
        if not os.WIFSTOPPED(status):
            return os.waitstatus_to_exitcode(status) % 256
        with contextlib.suppress(OSError):
            os.tcsetpgrp(screen, os.getpgrp())


if __name__ == "__main__":
    sys.exit(_work_as_shell(sys.argv[1], sys.argv[2:]))
