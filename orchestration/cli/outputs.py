"""Output files of a command, checked before any work; and JSON."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fmus.kit import UserError, quoting
from fmus.kit.extras import require
from orchestration.reporting import flag

STANDARD_OUTPUT = Path("-")
JSON = (".json",)
PAGE = (".html", ".htm")
PICTURE = (".png", ".svg", ".pdf")  # as in reporting.pictures, which takes time to load
# formats of the options that have the same in all commands
_FORMATS = {
    "json": JSON,
    "junit": (".xml",),
    "plot": PICTURE,
    "profile_plot": PICTURE,
    "corner": PICTURE,
    "report": PAGE,
}
_WRITTEN_BY = {
    ".parquet": ("pyarrow",),
    **dict.fromkeys((*PICTURE, *PAGE), ("matplotlib",)),
}
SIGNALS = (".nc", ".csv", ".parquet")  # as in experiment.results, which takes half a second to load


def typed_command() -> str:
    """Return the command as the user typed it, to be repeated in a page."""
    return quoting.shell(["ppy", *sys.argv[1:]])


def check_outputs(
    options: Mapping[str, Any],
    reads: Mapping[str, Path | None] = {},
    more: Mapping[str, Path] = {},
    folder: Path | None = None,
    **endings: Sequence[str],
) -> None:
    """Refuse paths that cannot be written, or that would overwrite another file.

    Parameters
    ----------
    options : Mapping of str to object
        Values of the options of a command; of these the files of known formats are written, and
        ``model`` is read. ``-`` for JSON is standard output.
    reads : Mapping of str to Path or None
        Further paths that the command reads, by role, as in ``this is the record itself``.
    more : Mapping of str to Path
        Further paths that it writes, by what the message calls them.
    folder : Path, optional
        Folder to write into.
    **endings : sequence of str
        Allowed file extensions by name of an option, if they are not those of all commands; any if
        there is none.

    Raises
    ------
    UserError
        If a path is a folder, is read by the command, is given twice, has the ending of another
        format, or cannot be written; or if a package that writes it is not installed.
    """
    from orchestration.cli.models import model_file

    formats = {**endings, **_FORMATS} | endings  # messages name those of the command first
    written = [
        (flag(name), options[name], allowed)
        for name, allowed in formats.items()
        if options.get(name) is not None
        and not (allowed == JSON and options[name] == STANDARD_OUTPUT)
    ]
    written += [(called, path, ()) for called, path in more.items()]
    model = options.get("model")
    reads = {**reads, "the model": model and model_file(model)}
    for k, (option, path, _) in enumerate(written):
        if _exists(option, path) and path.is_dir():
            raise UserError(f"{option} {path}: this is a folder; name a file in it")
        for role, source in reads.items():
            if source is not None and same_file(path, source):
                raise UserError(
                    f"{option} {path}: this is {role} itself; it will not be overwritten"
                )
        for other, place, _ in written[:k]:
            if same_file(path, place):
                raise UserError(f"{other} and {option} both name {path}")
    for option, path, allowed in written:
        _check_ending(option, path, allowed)
        _check_folder(path.absolute().parent, path)
    if folder is not None:
        _check_folder(folder.absolute(), folder)


def same_file(a: Path, b: Path) -> bool:
    """Return True if two names are, or would be, of one file."""
    return a.resolve() == b.resolve() or (a.exists() and b.exists() and a.samefile(b))


def _exists(option: str, path: Path) -> bool:
    try:
        return path.exists()
    except OSError as error:  # such as a name that is too long
        raise UserError(f"{option} {path}: {error.strerror}") from error


def _check_ending(option: str, path: Path, allowed: Sequence[str]) -> None:
    """Refuse a file extension of another format, or of one whose package is not installed."""
    if allowed and path.suffix.lower() not in allowed:
        endings = (" or " if len(allowed) == 2 else ", ").join(allowed)
        raise UserError(
            f"{option} {path}: its name must end in {endings}, not {path.suffix or 'nothing'!r}"
        )
    require(*_WRITTEN_BY.get(path.suffix.lower(), ()))


def _check_folder(folder: Path, path: Path) -> None:
    """Raise UserError if a folder is a file, or is read-only.

    If it does not exist, its nearest parent that does is checked; it is made later.
    """
    while not folder.exists():
        folder = folder.parent
    if not folder.is_dir() or not os.access(folder, os.W_OK):
        raise UserError(
            f"cannot write {path}: {folder} is {'read-only' if folder.is_dir() else 'no folder'}"
        )


def part_of(out: Path | None) -> Path | None:
    """Return the folder that keeps the finished part of a result until that is written, if any."""
    if out is None or out == STANDARD_OUTPUT:
        return None
    return out.with_name(f"{out.name}.part")


@contextmanager
def standard_output_for(path: Path | None) -> Iterator[None]:
    """Reserve standard output for JSON while the context lasts, if JSON is written there."""
    if path != STANDARD_OUTPUT:
        yield
        return
    from orchestration.reporting.console import results_withheld

    with results_withheld():
        yield


def write_json(path: Path | None, data: Any) -> None:
    """Write results as JSON; numbers that are not finite become null.

    Parameters
    ----------
    path : Path or None
        ``-`` is standard output; nothing is written without one.
    data : object
        Dictionaries, lists, texts, numbers and None.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    if path is None:
        return
    from orchestration.reporting import saving

    text = saving.json_text(data)
    if path == STANDARD_OUTPUT:
        sys.stdout.write(text)
        return
    from fmus.kit import files
    from orchestration.reporting.console import wrote

    files.write(path, text.encode())
    wrote(path)


def write_files(options: Mapping[str, Any], **writers: Callable[[Path], object]) -> None:
    """Write the files that options name, and print their names.

    Parameters
    ----------
    options : Mapping of str to object
        Values of the options of a command.
    **writers : callable
        By name of an option: writes its file.

    Raises
    ------
    UserError
        If a file cannot be written.
    """
    from orchestration.reporting.console import wrote

    for name, write in writers.items():
        path = options[name]
        if path is not None:
            write(path)
            wrote(path)


def show_and_write(
    result: Any, options: Mapping[str, Any], **writers: Callable[[Path], object]
) -> None:
    """Print a result, and write it as JSON and into the files that options name.

    Parameters
    ----------
    result : Displayable
        With a method ``to_dict``.
    options, writers
        See `write_files`.
    """
    from orchestration.reporting.console import out

    out.print(*result.overview(), sep="\n")
    write_json(options["json"], result.to_dict())
    write_files(options, **writers)
