"""Try every rule of the rig protocol with a server, and print which of them hold.

::

    python -m tests.support.rig.conformance tcp://127.0.0.1:5570

The rig is commanded to zero, stopped and released: switch its actuator off. The exit status is 1
if a rule is broken, and 2 if the server cannot be tried.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from fmus.kit import UserError
from orchestration.rig import read_endpoint
from tests.support.rig.conformance.check import check_server


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.support.rig.conformance",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("address", help="tcp://HOST:PORT of the server")
    parser.add_argument("--credentials", type=Path, help="keys, as for a proxy")
    parser.add_argument(
        "--beyond-limits",
        action="store_true",
        help="also send commands beyond each limit, which a right server refuses",
    )
    chosen = parser.parse_args(arguments)
    say = partial(print, file=sys.stderr)
    try:
        remote = read_endpoint(chosen.address, chosen.credentials, say)
        verdicts = check_server(remote, chosen.beyond_limits)
    except UserError as error:
        say(error)
        return 2
    return int(any(verdict.holds is False for verdict in verdicts))


if __name__ == "__main__":
    sys.exit(main())
