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
    """Print that the command was interrupted, and exit with the status of an interrupt.

    Parameters
    ----------
    kept : str
        Text about the finished work that is kept.

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
    """Print that a compiled module is cut off, and exit.

    Python writes such a module if the disk is full, does not notice it, and fails at every start
    from then on.

    Parameters
    ----------
    error : EOFError
        Raised by Python's reader of compiled modules.

    Raises
    ------
    SystemExit
        Always.
    """
    place = sys.pycache_prefix or f"the folders __pycache__ below {Path(__file__).parents[2]}"
    print(f"error: a compiled module is cut off ({error}); remove {place}", file=sys.stderr)
    sys.exit(2)


def is_of_import(error: EOFError) -> bool:
    """Return True if Python's import raised the error, not a reader of files or a worker."""
    *_, (last, _) = walk_tb(error.__traceback__)
    return last.f_globals is vars(_bootstrap_external)


@contextmanager
def kept_in(folder: Path | None, flag: str, items: str) -> Iterator[None]:
    """Exit at an interrupt with a line about the finished work in a journal.

    Parameters
    ----------
    folder : Path, optional
        Folder of the journal; None without one.
    flag : str
        Option that makes a journal.
    items : str
        Plural of the parts that it keeps, such as ``cases``.
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
