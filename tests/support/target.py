"""A module run for a target of the Makefile: an error meant for a user is one line, no traceback.

``python -m tests.support.target studies.release.folder --out dist/release`` does what
``python -m studies.release.folder --out dist/release`` does.
"""

from __future__ import annotations

import runpy
import sys

from fmus.kit import UserError


def main() -> None:
    """Run the module that the command line names, with the arguments that follow."""
    del sys.argv[0]
    try:
        # as `__main__` of this process, so that workers that it starts import the module itself
        runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
    except UserError as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    main()
