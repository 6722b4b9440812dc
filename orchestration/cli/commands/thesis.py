"""``ppy thesis``: the thesis recomputed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from orchestration.cli.options import Json
from orchestration.cli.outputs import JSON, Outputs, standard_output_for, write_json

if TYPE_CHECKING:
    from orchestration.thesis.claim import Claim


def thesis(
    out: Annotated[
        Path, typer.Option(metavar="FOLDER_OR_HTML", help="Where the page goes.")
    ] = Path("thesis.html"),
    result: Json = None,
) -> None:
    """Recompute the thesis: every table and simulated figure, what holds, what does not and why."""
    from orchestration.thesis import chapters, page

    Outputs(writes={"--out": page.target(out), "--json": result}, endings={"--json": JSON}).check()
    with standard_output_for(result):
        page.run(out)
        write_json(
            result,
            {
                "chapters": [
                    {"title": title, "claims": [_as_json(claim) for claim in claims]}
                    for title, claims in chapters.claims().items()
                ],
                "errata": [
                    {"number": e.number, "where": e.where, "printed": e.printed, "holds": e.holds}
                    for e in chapters.errata()
                ],
            },
        )


def _as_json(claim: Claim) -> dict[str, Any]:
    return {
        "where": claim.where,
        "what": claim.what,
        "published": claim.published,
        "reproduced": claim.reproduced,
        "unit": claim.unit or None,
        "verdict": claim.verdict,
        "difference": claim.difference,
        "reason": claim.reason or None,
        "erratum": claim.erratum,
        "from_print": claim.inferred,
    }
