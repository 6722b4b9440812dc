"""Claims: what commands call of an FMU is what the page says, and what the standards allow."""

from __future__ import annotations

import pytest

from docs import make_calling_sequence as made


@pytest.mark.slow
def test_the_page_is_what_an_fmu_writes_down():
    page = made.PAGE.read_text(encoding="utf-8")
    assert page == made.page(), "run python docs/make_calling_sequence.py"
