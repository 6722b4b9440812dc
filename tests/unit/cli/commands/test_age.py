"""Claims: ``ppy age`` writes what it found, and refuses in one line what it cannot follow."""

import json

import numpy as np
import pytest

from tests.support.command import ppy


def _write(path):
    time = 0.2 * np.arange(300)
    current = np.where((time + 2.5) % 10.0 < 5.0, 1.3, -1.3)
    rows = np.column_stack([time, current, 0.4 * current])
    np.savetxt(path, rows, "%.9g", ",", header="time [s],current [A],voltage [V]", comments="")


@pytest.mark.slow
def test_files_are_written(tmp_path):
    _write(tmp_path / "a.csv")
    outputs = "--json a.json --out w.csv --plot p.png --report r.html"
    done = ppy(*f"age a.csv --window 20s --fit R1,R2,C {outputs}".split(), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert len(json.loads((tmp_path / "a.json").read_text())["time"]) == 3
    assert len((tmp_path / "w.csv").read_text().splitlines()) == 4
    assert (tmp_path / "p.png").stat().st_size > 0
    assert "too few for a forecast" in (tmp_path / "r.html").read_text()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("age a.csv --of R3", "nothing is fitted named 'R3'"),
        ("age a.csv --rise 0%", "above 0%"),
        ("age none.csv", "none.csv"),
        ("age a.csv --report r.txt", ".html"),
    ],
)
def test_what_cannot_be_followed_is_one_line(tmp_path, options, said):
    _write(tmp_path / "a.csv")
    done = ppy(*options.split(), cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert "Traceback" not in done.stderr
