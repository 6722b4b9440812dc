"""Claims: ``ppy thesis`` writes its page, and its claims and errata as JSON."""

import json

import pytest

from tests.support.command import here


@pytest.mark.slow
def test_json_of_the_thesis(tmp_path):
    done = here("thesis", "--out", "t.html", "--json", "-", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    claims = [claim for chapter in answer["chapters"] for claim in chapter["claims"]]
    assert {claim["verdict"] for claim in claims} == {
        "holds",
        "within rounding",
        "only as printed",
        "differs",
    }
    assert len(answer["errata"]) > 30
    assert (tmp_path / "t.html").exists()
