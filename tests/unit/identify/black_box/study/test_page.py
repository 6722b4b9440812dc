"""Claims: the page holds the result in a sentence, the coefficients and the pictures."""

from __future__ import annotations

import pytest

from fmus.kit import UserError


@pytest.mark.slow
def test_the_page_holds_sentence_coefficients_and_five_pictures(found, tmp_path):
    page = found.report(tmp_path / "page.html").read_text(encoding="utf-8")
    assert "; its delay is 2 samples." in page
    assert found.sentence in page
    assert page.count("data:image/png") == 5
    assert "http" not in page.replace("http-equiv", "")
    for p in found.chosen.identification.parameters:
        assert f"{p.value:.6g}" in page
    with pytest.raises(UserError, match=r"\.html"):
        found.report(tmp_path / "page.txt")
