"""Diagnoses, and their pages, that the tests of the report share."""

from __future__ import annotations

import pytest

from orchestration.discrepancy.report.page import diagnosis_page
from tests.support.report_results import COMMAND, DiagnosedResults


@pytest.fixture(scope="session")
def results(tmp_path_factory):
    """A diagnosis for every kind of page."""
    return DiagnosedResults(tmp_path_factory.mktemp("pages"))


@pytest.fixture(scope="session")
def made(results):
    """Every page as text, made when it is first used."""

    class Pages(dict):
        def __missing__(self, name):
            self[name] = diagnosis_page(results[name], COMMAND).html()
            return self[name]

    return Pages()
