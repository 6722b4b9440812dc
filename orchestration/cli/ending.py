"""The end of a command that was interrupted, or that Python cannot load."""

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import _bootstrap_external
from pathlib import Path
from traceback import walk_tb
from typing import NoReturn

INTERRUPTED = 130  # 128 + SIGINT, as shells have it


def end_interrupted(kept: str = "") -> NoReturn:
    """Say that the command was interrupted, and end with the exit code of that.

    Parameters
    ----------
    kept : str
        Words on work that is kept.

    Raises
    ------
    SystemExit
        Always.
    """
    # pressed twice, it would end Python on its way out
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    print(f"interrupted: {kept}" if kept else "interrupted", file=sys.stderr)
    sys.exit(INTERRUPTED)


def end_unloadable(error: EOFError) -> NoReturn:
    """Say that compiled modules are cut off.

    Python leaves them so where a disk is full, takes them for whole, and fails at every further
    start.

    Parameters
    ----------
    error : EOFError
        As Python's reader of compiled modules raises it.

    Raises
    ------
    SystemExit
        Always.
    """
    place = sys.pycache_prefix or f"the folders __pycache__ below {Path(__file__).parents[2]}"
    print(f"error: a compiled module is cut off ({error}); remove {place}", file=sys.stderr)
    sys.exit(2)


def is_of_import(error: EOFError) -> bool:
    """Return True if Python's import raised an error, and not the reader of a file or a worker."""
    *_, (last, _) = walk_tb(error.__traceback__)
    return last.f_globals is vars(_bootstrap_external)


@contextmanager
def kept_in(folder: Path | None, flag: str, items: str) -> Iterator[None]:
    """End an interrupt with a line on the work that a journal has stored.

    Parameters
    ----------
    folder : Path, optional
        Of the journal.
    flag : str
        Option without which there is none.
    items : str
        Parts that it keeps.
    """
    try:
        yield
    except KeyboardInterrupt:
        if folder is None:
            end_interrupted(f"nothing is kept; with {flag} FILE the same command would go on")
        from orchestration.journal import count_done

        done, whole = count_done(folder)
        if not done:
            end_interrupted(f"none of the {items} was done")
        end_interrupted(
            f"{done:,} of {whole:,} {items} are kept in {folder}, and the same command goes on from"
            " there"
        )
