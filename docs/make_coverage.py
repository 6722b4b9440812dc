"""Make the page of what the thesis has and which command shows it, from ``coverage.toml``.

``python docs/make_coverage.py`` writes it anew; a test runs every command.
"""

from __future__ import annotations

import itertools
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

DOCS = Path(__file__).parent
PAGE = DOCS / "coverage.md"
# Python that draws the records that rows are about, in the folder of the commands
RECORDS = (
    "from demonstrations.records import draw, write; "
    "[write(draw(None, seed=k, duration=60.0), name)"
    " for k, name in enumerate(('record.csv', 'later.csv', 'latest.csv'))]"
)
_INTRODUCTION = f"""\
# What the thesis has, and the command that shows it

Made by `python docs/make_coverage.py` from `docs/coverage.toml`, do not edit. A test runs every
command, in one folder. Records are drawn first:

```console
$ python -c "{RECORDS}"
```

`ppy thesis` writes a page on which each printed figure stands beside the recomputed one
([how](how-to/thesis.md)); where the two differ, the [errata](errata.md) say why. Photographs,
anatomy (appendix C) and lists of references have no row.
"""


@dataclass(frozen=True)
class Row:
    """A place of the thesis, or a workflow.

    Attributes
    ----------
    where, what : str
    command : str
        Shows it.
    missing : str
        Empty if all of it works.
    """

    where: str
    what: str
    command: str
    missing: str


def parts() -> dict[str, list[Row]]:
    """Return the rows by the title of their part."""
    table = tomllib.loads((DOCS / "coverage.toml").read_text(encoding="utf-8"))
    return {part["title"]: [Row(*row) for row in part["rows"]] for part in table["part"]}


def page() -> str:
    """Return the page as Markdown."""
    return "\n".join([_INTRODUCTION, *_lines()])


def _lines() -> Iterator[str]:
    numbers = itertools.count(1)
    for title, rows in parts().items():
        whole = sum(not row.missing for row in rows)
        yield f"## {title}\n\n{whole} of {len(rows)} rows work in full.\n"
        yield "| # | where | what | shown by | |\n|---|---|---|---|---|"
        for row in rows:
            state = f"in part: {row.missing}" if row.missing else "works"
            yield f"| {next(numbers)} | {row.where} | {row.what} | `{row.command}` | {state} |"
        yield ""


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
    print(PAGE)
