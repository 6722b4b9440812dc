"""The page of a specimen: its tests, its parameters, what is missing, and the fit in full."""

from __future__ import annotations

from demonstrations.characterise.characterisation import HEAD, TESTS, Characterisation
from orchestration.reporting import make_page
from orchestration.reporting.html import Markup, Page, escaped


@make_page.register(Characterisation)
def characterisation_page(found: Characterisation, command: str = "") -> Page:
    """Make the page of a characterised specimen."""
    known, missing = found.determined, found.missing
    count = f"{len(known)} of {len(known) + len(missing)} parameters"
    verdict = f"Not determined: {', '.join(missing)}." if missing else "Nothing is missing."
    about = Markup(f"<code>{escaped(found.model.name)}</code>")
    page = Page(f"{count} of the specimen are known", verdict, about)
    page.heading("Which tests the records are")
    page.table(TESTS, [*found.kind_rows()])
    page.heading("Its parameters")
    page.table(HEAD, [*found.rows()])
    page.text(
        "Graphical: as the thesis reads a parameter off one record; its interval is by the noise of"
        " that record, and by the bias of the method where the reading of its own curve shows one."
        " Fitted: by all records together, in a free run of the model; the"
        " interval allows for coloured residuals. Before a step of the load its first value is"
        " taken to have been there until the creep had ended; all other records may begin in any"
        " state."
    )
    if missing:
        page.heading("What is not determined, and which test would tell")
        page.items([f"{name}: {advice}." for name, advice in missing.items()])
    if found.remarks:
        page.items(found.remarks)
    page.include(make_page(found.joint, command))
    return page
