"""Output of ``ppy thesis``: a table on the terminal, and a page with the figures."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from rich.table import Table

from demonstrations.thesis import chapters
from demonstrations.thesis.claim import Claim
from fmus.kit import UserError, quoting
from orchestration.reporting import console
from orchestration.reporting.html import Page

_STYLE = {"holds": "", "within rounding": "", "only as printed": "yellow", "differs": "red"}
_COUNTED = {
    "holds": "hold",
    "within rounding": "are within the rounding of their inputs",
    "only as printed": "are reproduced but wrong",
    "differs": "differ",
}


def run(out: Path) -> Path:
    """Recompute the thesis, write the page, print the table.

    Parameters
    ----------
    out : Path
        An .html file, or a folder for ``thesis.html``.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    UserError
        If the page cannot be written, or there is no compiler for the coupled components.
    """
    path = target(out)
    with console.progress("recomputing tables and equations") as tell:
        by_chapter = chapters.claims()
        page = Page("The thesis, recomputed", _verdict(by_chapter))
        page.text(
            "Every figure that does not need the lost data, recomputed from the models. A figure"
            " holds if the computed value rounds to the printed one; within rounding means that the"
            " rounding of the printed inputs accounts for the difference. Only as printed: the"
            " program printed in the thesis gives it, and it is still wrong. From print: the thesis"
            " prints no such figure, but one that it follows from, or an equation that another is"
            " held against."
        )
        drawings = chapters.illustrations()
        tell("drawing the figures")
        done = 0
        count = sum(map(len, drawings.values()))
        for title, claims in by_chapter.items():
            page.heading(title)
            page.parts.append(_table(claims))
            for drawing in drawings[title]:
                tell.done(done, count, drawing.title)
                done += 1
                page.figure(drawing.draw(), f"{drawing.title}. {drawing.caption}")
        page.heading("Errata")
        rows = [[str(e.number), e.where, e.printed, e.holds] for e in chapters.errata()]
        page.parts.append(
            _wrap(("#", "where", "printed", "what holds"), rows, widths={1: 8, 2: 12, 3: 16})
        )
        page.write(path)
    show(by_chapter)
    console.out.print(f"\n{_verdict(by_chapter)}\nwrote {path}")
    return path


def target(out: Path) -> Path:
    """Return the file of the page.

    Raises
    ------
    UserError
        If `out` is neither a folder nor an .html file, or the file cannot be created.
    """
    try:
        named = out.suffix.lower() in (".html", ".htm") and not out.is_dir()
        if not named and not out.is_dir() and (out.suffix or out.exists()):
            raise UserError(f"--out {out}: name a folder or a file that ends in .html")
        path = out if named else out / "thesis.html"
        above = next(p for p in path.absolute().parents if p.exists())
        if not (above.is_dir() and os.access(above, os.W_OK)):
            raise UserError(f"--out {out}: cannot write in {above}")
        if path.is_dir() or (path.is_symlink() and not path.exists()):
            raise UserError(f"--out {out}: {path} is there and no file")
    except OSError as error:
        raise UserError(f"--out {out}: {error.strerror or error}") from error
    return path


def _verdict(by_chapter: dict[str, list[Claim]]) -> str:
    every = [claim for claims in by_chapter.values() for claim in claims]
    printed, inferred = (
        _count_verdicts([c for c in every if c.inferred is kind]) for kind in (False, True)
    )
    return (
        f"{printed[0]} printed figures and statements: {printed[1]}. {inferred[0]} that follow from"
        f" print: {inferred[1]}. Each that does not hold has its reason; {len(chapters.errata())}"
        " errata."
    )


def _count_verdicts(claims: Sequence[Claim]) -> tuple[int, str]:
    """Return the number of claims, and the number with each verdict, as a text."""
    count = Counter(c.verdict for c in claims)
    return len(claims), ", ".join(
        f"{count[verdict]} {words}" for verdict, words in _COUNTED.items() if count[verdict]
    )


def show(by_chapter: dict[str, list[Claim]]) -> None:
    """Print the claims by chapter."""
    for title, claims in by_chapter.items():
        table = Table(
            title=title,
            title_justify="left",
            title_style="bold",
            box=None,
            pad_edge=False,
            expand=True,
        )
        for column, ratio in (("where", 5), ("quantity", 8)):
            table.add_column(column, ratio=ratio)
        for column, ratio in (("published", 4), ("reproduced", 5)):
            table.add_column(column, ratio=ratio, justify="right")
        table.add_column("difference", justify="right", no_wrap=True)
        table.add_column("note", ratio=10)
        for c in claims:
            cells = [c.where, c.what, _published(c), _value(c), _difference(c), _note(c)]
            table.add_row(*cells, style=_STYLE[c.verdict])
        console.out.print(table, soft_wrap=False)
        console.out.print()


def _published(claim: Claim) -> str:
    return claim.published + " (from print)" * claim.inferred


def _value(claim: Claim) -> str:
    return f"{claim.reproduced_text} {claim.unit}".strip()


def _difference(claim: Claim) -> str:
    d = claim.difference
    if d is None or abs(d) < 1e-9:
        return "" if d is None else "0 %"
    return f"{100 * d:+.0f} %" if abs(d) >= 0.995 else f"{100 * d:+.2g} %"


def _note(claim: Claim, brief: bool = True) -> str:
    """Return the verdict of a claim, the correct value and the reason, as a text."""
    if brief and claim.verdict == "holds":
        return "holds"
    holds = f"holds: {claim.consistent}" if claim.consistent else ""
    row = f"errata {claim.erratum}" if claim.erratum else ""
    return "; ".join(filter(None, [claim.verdict, holds, claim.reason, row]))


def _table(claims: Sequence[Claim]) -> str:
    head = ("where", "quantity", "published", "reproduced", "difference", "note")
    rows = [
        [c.where, c.what, _published(c), _value(c), _difference(c), _note(c, brief=False)]
        for c in claims
    ]
    return _wrap(head, rows, widths={0: 6, 1: 9, 5: 14}, marked=[not c.holds for c in claims])


def _wrap(
    head: Sequence[str],
    rows: Sequence[Sequence[str]],
    widths: Mapping[int, int],
    marked: Sequence[bool] = (),
) -> str:
    """Return a table with line breaks in some columns, of a least width in rem, and marked rows."""
    styles = [
        f' style="white-space:normal;min-width:{widths[k]}rem"' if k in widths else ""
        for k in range(len(head))
    ]
    columns = "".join(f"<th>{quoting.html(cell)}</th>" for cell in head)
    body = ""
    for n, row in enumerate(rows):
        colour = ' style="background:#fdf0f1"' if marked and marked[n] else ""
        cells = "".join(
            f"<td{style}>{quoting.html(cell)}</td>" for style, cell in zip(styles, row, strict=True)
        )
        body += f"<tr{colour}>{cells}</tr>"
    return f'<div class="table"><table><tr>{columns}</tr>{body}</table></div>'
