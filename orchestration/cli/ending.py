"""The end of a command that was interrupted."""

import signal
import sys
from typing import NoReturn

INTERRUPTED = 130  # 128 + SIGINT, as shells have it


def end_interrupted() -> NoReturn:
    """Say that the command was interrupted, and end with the exit code of that.

    Raises
    ------
    SystemExit
        Always.
    """
    # pressed twice, it would end Python on its way out
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    print("interrupted", file=sys.stderr)
    sys.exit(INTERRUPTED)
