"""Verdicts of a command for continuous integration: JUnit, annotations, exit status.

Exit status 1 is that of a command that judged and found something wrong; 2 is that of one that
could not judge.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import typer

from fmus.kit import files, quoting

_IN_TEXT = str.maketrans({"%": "%25", "\r": "%0D", "\n": "%0A"})
_IN_PROPERTY = _IN_TEXT | str.maketrans({":": "%3A", ",": "%2C"})


class Case(NamedTuple):
    """One thing that is judged.

    Attributes
    ----------
    subject : str
        File or model that is judged.
    name : str
        What is judged of it, such as a signal.
    failure : str
        Why it fails; empty if it does not.
    skipped : str
        What is wrong and does not count, with the reason; empty if there is nothing.
    """

    subject: str
    name: str
    failure: str = ""
    skipped: str = ""


def conclude(command: str, cases: Sequence[Case], junit: Path | None) -> None:
    """Write cases as JUnit if a file is named, annotate those that fail, and exit if there are any.

    Parameters
    ----------
    command : str
        Name of the test suite, such as ``ppy check``.
    cases : sequence of Case
    junit : Path, optional

    Raises
    ------
    typer.Exit
        With status 1, if a case fails.
    UserError
        If the file cannot be written.
    """
    if junit is not None:
        from orchestration.reporting.console import wrote

        files.write(junit, _junit(command, cases))
        wrote(junit)
    failing = [case for case in cases if case.failure]
    for case in failing:
        annotate(case.failure, f"{command}: {case.name}", case.subject)
    if failing:
        raise typer.Exit(1)


def annotate(message: str, title: str = "ppy", file: str = "") -> None:
    """Print an error as a workflow command of GitHub Actions; nothing anywhere else.

    The runner looks for such commands in both streams; standard output may be JSON.
    """
    if os.environ.get("GITHUB_ACTIONS") != "true":
        return
    place = f"file={file.translate(_IN_PROPERTY)}," if file else ""
    heading = title.translate(_IN_PROPERTY)
    print(f"::error {place}title={heading}::{message.translate(_IN_TEXT)}", file=sys.stderr)


def _junit(command: str, cases: Sequence[Case]) -> bytes:
    """Return cases as a test suite in the form of Ant's JUnit task, which CI servers read."""
    counts = {
        "tests": len(cases),
        "failures": sum(bool(case.failure) for case in cases),
        "errors": 0,
        "skipped": sum(bool(case.skipped and not case.failure) for case in cases),
    }
    about = {"name": command} | {name: str(count) for name, count in counts.items()}
    root = ElementTree.Element("testsuites", about)
    suite = ElementTree.SubElement(root, "testsuite", about)
    for case in cases:
        named = {"classname": case.subject, "name": case.name, "time": "0"}
        shown = {key: quoting.visible(text) for key, text in named.items()}
        element = ElementTree.SubElement(suite, "testcase", shown)
        outcome = "failure" if case.failure else "skipped"
        message = case.failure or case.skipped
        if message:
            ElementTree.SubElement(element, outcome, message=quoting.visible(message))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
