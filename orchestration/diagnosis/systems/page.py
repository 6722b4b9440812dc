"""The page of a system: the verdict on each member, and the diagnosis of each part."""

from __future__ import annotations

from fmus.kit.titles import capitalised
from orchestration.diagnosis.page import part_page
from orchestration.diagnosis.systems.diagnosis import SystemDiagnosis
from orchestration.diagnosis.systems.report import MEMBER_HEAD, SystemView, view_of
from orchestration.reporting import make_page
from orchestration.reporting.html import Markup, Page, elements, escaped, format_quantities


@make_page.register(SystemDiagnosis)
def system_page(diagnosis: SystemDiagnosis, command: str = "") -> Page:
    """Make the page of the diagnosis of a system; see `view_of`."""
    return view_page(view_of(diagnosis, command))


@make_page.register(SystemView)
def view_page(shown: SystemView, command: str = "") -> Page:
    """Make the page of the diagnosis of a system from what is shown of it.

    Parameters
    ----------
    shown : SystemView
    command : str
        In place of the one that made it.
    """
    about = (
        f"Diagnosis of <code>{escaped(shown.system)}</code> on <code>{escaped(shown.file)}</code>"
    )
    chip = elements.chip(shown.verdict, shown.verdict)
    verdict = Markup(f"{chip} {format_quantities(shown.reason)}")
    page = Page(shown.sentence, verdict, Markup(about))
    page.heading("Members")
    rows = []
    for name, verdict_on, judged, why in shown.members:
        rows.append((name, elements.chip(verdict_on, verdict_on), judged, format_quantities(why)))
    page.table([capitalised(title) for title in MEMBER_HEAD], rows)
    for part in shown.parts:
        page.include(part_page(part.label, part.shown))
    page.made_by(command or shown.command, shown.facts)
    return page
