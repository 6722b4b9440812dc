"""Claims: the commands of the page on public records give the figures known to hold for them."""

import json
import re
import shlex
from pathlib import Path

import matplotlib.image
import pytest

from tests.support.command import ppy

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "public-records.md"


def command_of(record):
    """The page's command for a record, as arguments."""
    text = PAGE.read_text(encoding="utf-8").replace("\\\n", " ")
    found = [
        line for line in text.splitlines() if line.startswith("ppy compare") and record in line
    ]
    assert len(found) == 1
    return shlex.split(found[0])[1:]


def run(record, public_data, folder):
    """Run the page's command where the record is; returns the figures, and what was told."""
    path = public_data(record)
    arguments = [str(path) if a.endswith(record) else a for a in command_of(record)]
    done = ppy(*arguments, "--out", "figures.json", cwd=folder)
    assert done.returncode == 0, done.stderr
    picture = folder / arguments[arguments.index("--plot") + 1]
    assert matplotlib.image.imread(picture)[..., :3].std() > 0.05
    return json.loads((folder / "figures.json").read_text(encoding="utf-8")), done


@pytest.mark.slow
def test_creep_of_a_polyethylene_melt(public_data, tmp_path):
    """Burgers parameters of a foreign material; at 10 N the compliances are those at 10 Pa, so the
    units carry over.
    """
    figures, done = run("creep_polyethylene_cm3.csv", public_data, tmp_path)
    assert "46 rows repeat the time of an earlier row" in done.stderr
    assert figures["record"]["samples"] == 279
    fitted = figures["fitted"]["outputs"]["displacement"]
    assert figures["outputs"]["displacement"]["fit_percent"] < 0.0  # an actuator is no melt
    assert fitted["fit_percent"] == pytest.approx(99.75, abs=0.02)
    for page in (PAGE, ROOT / "docs" / "explanation.md"):
        assert f"fits {fitted['fit_percent']:.2f} %" in page.read_text(encoding="utf-8")
    assert fitted["white"] is False
    # flow at the end of the record: a viscosity of strain rate over stress, by hand from its last
    # decade
    viscosity = figures["fitted"]["parameters"]["b1"]["value"]
    rows = [
        line.split(",")
        for line in public_data("creep_polyethylene_cm3.csv")
        .read_text(encoding="utf-8")
        .splitlines()[1:]
    ]
    late = [(float(t), float(e)) for t, _, e in rows if float(t) > 1000.0]
    slope = (late[-1][1] - late[0][1]) / (late[-1][0] - late[0][0])
    assert viscosity == pytest.approx(10.0 / slope, rel=0.05)


def on_the_page():
    """The least fit that the page promises for the cell, in percent."""
    found = re.search(r"the cell more than (\d+) %", PAGE.read_text(encoding="utf-8"))
    assert found is not None
    return float(found[1])


@pytest.mark.slow
@pytest.mark.parametrize(("age", "least"), [("before", on_the_page()), ("after", 90.0)])
def test_a_supercapacitor(public_data, tmp_path, age, least):
    """The cell before ageing is the page's command; after it is the same with the other file."""
    if age == "before":
        figures, done = run("supercapacitor_before_ageing_5mV_per_s.csv", public_data, tmp_path)
    else:
        other = public_data("supercapacitor_after_ageing_5mV_per_s.csv")
        command = command_of("supercapacitor_before_ageing_5mV_per_s.csv")
        arguments = [str(other) if a.endswith(".csv") else a for a in command]
        done = ppy(*arguments, "--out", "figures.json", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        figures = json.loads((tmp_path / "figures.json").read_text(encoding="utf-8"))
    assert not re.search("internal|Traceback", done.stderr)
    fitted = figures["fitted"]
    assert fitted["outputs"]["voltage"]["fit_percent"] > least
    assert fitted["outputs"]["voltage"]["white"] is False
    # capacitance by hand: charge moved over voltage swept, which leaves out R1 and leakage and so
    # agrees only roughly
    value = fitted["parameters"]["C"]["value"]
    assert value == pytest.approx(
        by_hand(public_data(f"supercapacitor_{age}_ageing_5mV_per_s.csv")), rel=0.2
    )
    # one RC branch is too few
    assert sum("varies slowly" in w for w in fitted["warnings"]) == 1


def by_hand(path):
    """Mean |current| over mean |rate of voltage|, F: the capacitance of a cell that is swept up and
    down.
    """
    rows = [
        tuple(map(float, line.split(",")))
        for line in path.read_text(encoding="utf-8").splitlines()[1:]
    ]
    moved = swept = 0.0
    for (t0, u0, i0), (t1, u1, _) in zip(rows[:-20], rows[20:], strict=True):
        moved += 1e-3 * abs(i0) * (t1 - t0)
        swept += abs(u1 - u0)
    return moved / swept
