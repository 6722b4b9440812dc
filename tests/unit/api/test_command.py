"""Claims: the command in a report made from Python asks the command line for the same."""

from __future__ import annotations

import shlex

import numpy as np
import pytest

import orchestration as ppy
from demonstrations.records import draw, write
from orchestration.cli import diagnose as work
from orchestration.cli.app import main
from tests.support.diagnosis import SHORT
from tests.support.pace import slow_but

OPTIONS = {
    "effects": [],
    "hold": ["k2"],
    "each": ["R1"],
    "interpolate": False,
    "time": 30.0,
    "settings": {"k2": "9000[N/m]"},
    "laws": False,
}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("records")
    for seed, name in enumerate(("a.csv", "b.csv", "c.csv"), 1):
        write(draw(None, seed, **SHORT), folder / name)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("held", slow_but(["another", "of several"], "of several"))
def test_the_command_of_a_report_asks_for_the_same(files, held, monkeypatch):
    monkeypatch.chdir(files)
    fitted, holdout = ("a.csv", "b.csv") if held == "another" else (["a.csv", "b.csv"], "b")
    result = ppy.diagnose(fitted, holdout=holdout, compare="c.csv", **OPTIONS)
    page = result.report("r.html").read_text(encoding="utf-8")
    command = result._command
    assert shlex.join(shlex.split(command)) in page.replace("&#39;", "'").replace("&#x27;", "'")

    told = []

    def asked(records, model, **options):
        told.extend((records, options))
        raise SystemExit

    monkeypatch.setattr(work, "diagnose", asked)
    monkeypatch.setattr("sys.argv", shlex.split(command))
    with pytest.raises(SystemExit):
        main()
    records, options = told
    assert [r.source.name for r in records] == [r.source.name for r in result.records]
    assert [r.source.name for r in options["holdout"]] == [
        r.source.name for r in result.details.holdouts
    ]
    assert [*map(str, options["compare"])] == ["c.csv"]
    for name, value in OPTIONS.items():
        assert options[name] == value, name
    assert np.array_equal(records[0].time, result.record.time)
