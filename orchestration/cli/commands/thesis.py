"""``ppy thesis`` and ``ppy demo``: the studies that are commands."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from orchestration.cli.command import command
from orchestration.cli.commands.options import DemoCommand, ThesisCommand
from orchestration.cli.outputs import JSON, Outputs, standard_output_for, write_json

if TYPE_CHECKING:
    from studies.thesis import Claim


@command(DemoCommand)
def demo(options: DemoCommand) -> None:
    """Do everything once: build, simulate, compare with an emulated rig, diagnose, report."""
    from studies.demo import everything as work

    Outputs(folders={"--out": options["out"]}).check()
    work.run(options["out"])


@command(ThesisCommand)
def thesis(options: ThesisCommand) -> None:
    """Recompute the thesis: every table and simulated figure, what holds, what does not and why."""
    from studies.thesis import chapters, page

    out = options["out"]
    path = options["json"]
    Outputs(writes={"--out": page.target(out), "--json": path}, endings={"--json": JSON}).check()
    with standard_output_for(path):
        page.run(out)
        written = [
            {"title": title, "claims": [_as_json(claim) for claim in claims]}
            for title, claims in chapters.claims().items()
        ]
        errata = [
            {"number": e.number, "where": e.where, "printed": e.printed, "holds": e.holds}
            for e in chapters.errata()
        ]
        write_json(path, {"chapters": written, "errata": errata})


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
