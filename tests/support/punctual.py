"""Check of the machine's own punctuality: delays of a busy machine are no fault of the tested code.

A process of its own sleeps for some milliseconds, again and again, and writes down when it was
woken much too late. A test marked ``real_time`` that fails while that happened is not judged: it is
reported as skipped, with the pause. One that promises less than usual says so:
``real_time(limit=0.005)``.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

# s, beyond which promises of milliseconds cannot be kept, unless a test says another limit
LATE = 0.04
_SEEN = 0.004  # s
_WATCH = """
import sys, time
with open(sys.argv[1], "a", buffering=1) as log:
    while True:
        before = time.time()
        time.sleep(0.005)
        late = time.time() - before - 0.005
        if late > float(sys.argv[2]):
            log.write(f"{before} {late}\\n")
"""


class Watch:
    """Watches the machine from its first use on."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._log = Path()

    def start(self) -> None:
        """Begin, unless it has begun."""
        if self._process is None:
            self._log = Path(tempfile.mkdtemp(prefix="ppy-punctual-")) / "late.txt"
            self._process = subprocess.Popen(
                [sys.executable, "-I", "-S", "-c", _WATCH, str(self._log), str(_SEEN)]
            )

    def longest(self, begin: float, end: float, limit: float = LATE) -> float:
        """Longest pause of the machine between two times of the wall clock, in s; 0 if none was
        above a limit.
        """
        lines = self._log.read_text().splitlines() if self._log.is_file() else []
        pauses = [tuple(map(float, line.split())) for line in lines if line.count(" ") == 1]
        return max(
            (late for at, late in pauses if at < end and at + late > begin and late > limit),
            default=0.0,
        )

    def stop(self) -> None:
        """End."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._log.unlink(missing_ok=True)
            self._log.parent.rmdir()
            self._process = None
