"""The page of a system: the verdict on each member, and the diagnosis of each part."""

from __future__ import annotations

import shlex

from fmus.kit.titles import capitalised
from orchestration.diagnosis.page import part_page
from orchestration.diagnosis.systems.diagnosis import SystemDiagnosis
from orchestration.diagnosis.systems.report import MEMBER_HEAD, member_rows, sentence
from orchestration.reporting import flag, make_page
from orchestration.reporting.html import Markup, Page, elements, escaped, format_quantities


@make_page.register(SystemDiagnosis)
def system_page(diagnosis: SystemDiagnosis, command: str = "") -> Page:
    """Make the page of the diagnosis of a system.

    Parameters
    ----------
    diagnosis : SystemDiagnosis
    command : str
        That made it; unless given, one that makes the same.
    """
    source = diagnosis.record.source
    about = (
        f"Diagnosis of <code>{escaped(diagnosis.system)}</code> on"
        f" <code>{escaped(source.name)}</code>"
    )
    chip = elements.chip(str(diagnosis.verdict), str(diagnosis.verdict))
    page = Page(sentence(diagnosis), Markup(f"{chip} {_first_reason(diagnosis)}"), Markup(about))
    page.heading("Members")
    rows = []
    for name, verdict, judged, why in member_rows(diagnosis):
        rows.append((name, elements.chip(verdict, verdict), judged, format_quantities(why)))
    page.table([capitalised(title) for title in MEMBER_HEAD], rows)
    for part in diagnosis.parts:
        if part.diagnosis is not None:
            page.include(part_page(part.part.label, part.diagnosis))
    page.reproduction([source], command or _command(diagnosis))
    return page


def _first_reason(diagnosis: SystemDiagnosis) -> Markup:
    """Return why the first suspect is one; empty without any."""
    first = next(iter(diagnosis.wrong), None)
    rows = {name: why for name, _, _, why in member_rows(diagnosis)}
    return Markup(format_quantities(f"{first.name}: {rows[first.name]}." if first else ""))


def _command(diagnosis: SystemDiagnosis) -> str:
    """Return a command that makes the same diagnosis."""
    words = ["ppy", "diagnose", str(diagnosis.record.source), flag("system"), diagnosis.system]
    return shlex.join(words)
