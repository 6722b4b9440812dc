"""Files of a specimen: its parameters as TOML, which ``--params`` takes, and a README."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from demonstrations.characterise.characterisation import HEAD, Characterisation
from fmus.kit import files
from orchestration.reporting import write_page

PARAMETERS, README, PAGE = WRITTEN = ("specimen.toml", "README.md", "specimen.html")


def write_files(found: Characterisation, folder: Path, command: str = "") -> list[Path]:
    """Write parameters, README and page of a specimen into a folder, and return their paths.

    Parameters
    ----------
    found : Characterisation
    folder : Path
        Its name is that of the specimen; it is made if it does not exist.
    command : str
        That characterised it.

    Raises
    ------
    UserError
        If a file cannot be written.
    """
    name = folder.absolute().name
    texts = {PARAMETERS: _toml(found, name), README: _readme(found, name, command)}
    for file, lines in texts.items():
        files.write(folder / file, "\n".join([*lines, ""]).encode())
    page = write_page(found, folder / PAGE, command)
    return [*(folder / file for file in texts), page]


def _toml(found: Characterisation, name: str) -> Iterator[str]:
    """Yield the lines of the file of parameters, SI."""
    yield f"# {name}, fitted to {', '.join(found.kinds)}, with 95 % intervals"
    yield "# ppy simulate, run, compare, ... --params specimen.toml"
    yield f'model = "{found.model.name}"'
    yield ""
    yield "[parameters]"
    for parameter, value in found.determined.items():
        estimate = found.fit.estimates[parameter]
        low, high = estimate.interval
        text = f"{value:.10g} {estimate.unit}".strip()
        yield f'{parameter} = "{text}"  # {low:.5g} to {high:.5g}'
    for parameter in found.missing:
        yield f"# {parameter}: not determined"


def _readme(found: Characterisation, name: str, command: str) -> Iterator[str]:
    """Yield the lines of the README."""
    yield f"# {name}"
    yield ""
    yield f"A specimen of `{found.model.name}`, characterised by {len(found.kinds)} records."
    yield ""
    yield from _table(("record", "test", "tells"), [*found.kind_rows()])
    yield from _table(HEAD, [*found.rows()])
    for parameter, advice in found.missing.items():
        yield f"* `{parameter}` is not determined: {advice}"
    yield from (f"* {text}" for text in (*found.remarks, *found.fit.warnings))
    yield ""
    yield f"`{PARAMETERS}` has the fitted values, for any command; `{PAGE}` shows the records."
    yield ""
    yield "```sh"
    if command:
        yield command
    yield f"ppy simulate {found.model.name} --params {PARAMETERS} --set current=0.5 --stop 10s"
    yield "```"


def _table(head: tuple[str, ...], rows: list[list[str]]) -> Iterator[str]:
    """Yield the lines of a table in Markdown, and an empty one."""
    for cells in (head, ["---"] * len(head), *rows):
        yield f"| {' | '.join(cells)} |"
    yield ""
