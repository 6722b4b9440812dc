"""Claims: ``ppy run`` tells what it ran and whether a result is the same again, and it overwrites
nothing that it reads.
"""

import re
import shutil

import numpy as np
import pytest
from junitparser import JUnitXml

from orchestration.experiment import results
from orchestration.fmu.model import find_model
from tests.support.command import answered, here, refused, works
from tests.support.experiments import GOOD, good_experiment, played_record


def test_json_of_run(tmp_path):
    answer = answered("run", "fig_3_4", "--set", "duration=2", "--out", "r.nc", cwd=tmp_path)
    assert (answer["subject"], answer["complete"], answer["seconds"]) == ("ppy_actuator", True, 2.0)
    assert answer["signals"]["current"]["largest"] == 0.9
    assert answer["again"] is None
    again = answered("run", "r.nc", cwd=tmp_path)["again"]
    assert (again["reference"], again["same"], again["new"]) == ("r.nc", True, [])
    assert {one["difference"] for one in again["signals"].values()} == {0.0}


@pytest.fixture
def folder(tmp_path):
    return good_experiment(tmp_path)


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["fig_3_33"], ["fig_3_33", "did you mean fig_3_3?"]),
        (["gone.toml"], ["gone.toml", "no such file"]),
        (["."], ["error: .: a folder"]),
        ([""], ["error: .: a folder"]),
        ([], ["ppy run --list"]),
        (["record.csv"], ["record.csv", "not a result of ppy run"]),
        (["out.nc"], ["out.nc", "not a result of ppy run"]),
        (["good.toml", "--set", "duration"], ["--set duration: ", "key=value"]),
        (["good.toml", "--set", "R9=1"], ["no parameter named 'R9'"]),
        (
            ["good.toml", "--set", "durration=1"],
            ["no parameter named 'durration'", "did you mean duration?"],
        ),
        (
            ["good.toml", "--set", "inputs.force.value=1"],
            ["--set inputs.force.value=1", "force is a value"],
        ),
        (
            ["good.toml", "--set", "inputs.current.amplitud=1"],
            ["inputs.current: unknown key 'amplitud'"],
        ),
        (
            ["good.toml", "--set", "duration.of.it=1"],
            ["--set duration.of.it=1", "duration is a value"],
        ),
        (["good.toml", "--runtime", "fortran"], ["--runtime 'fortran'", "native, python"]),
        (["good.toml", "--out", "out.xls"], ["--out out.xls", ".nc, .csv, .parquet"]),
        (
            ["good.toml", "--out", "good.toml"],
            ["--out good.toml", "experiment itself", "not be overwritten"],
        ),
        (["good.toml", "--out", "record.csv/out.nc"], ["cannot write record.csv/out.nc"]),
        (["good.toml", "--out", "."], ["--out .", "folder"]),
        (["good.toml", "--plot", "out.bmp"], ["out.bmp", ".png, .svg, .pdf"]),
        (["good.toml", "--out", "a.csv", "--plot", "a.csv"], ["both name a.csv"]),
    ],
    ids=lambda value: " ".join(value),
)
def test_command_lines_that_ask_for_the_impossible(folder, arguments, parts):
    refused(folder, "run", *arguments, parts=parts)


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (["--out", "record.csv"], "record for current"),
        (["--plot", "record.html", "--out", "out.nc"], "record for force"),
        (["--plot", "page.html"], "component"),
        (["--out", "linked.csv"], "record for current"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_nothing_that_an_experiment_reads_is_overwritten(folder, arguments, what):
    shutil.copy(folder / "record.csv", folder / "record.html")
    shutil.copy(find_model("ppy_actuator").path, folder / "page.html")
    (folder / "linked.csv").hardlink_to(folder / "record.csv")
    text = GOOD.split("[inputs]")[0].replace('"ppy_actuator"', '"page.html"')
    text += (
        '[inputs]\ncurrent = {kind = "file", file = "record.csv"}\nforce = {kind = "file", file ='
        ' "record.html"}'
    )
    (folder / "own.toml").write_text(text, encoding="utf-8")
    refused(
        folder,
        "run",
        "own.toml",
        *arguments,
        parts=[arguments[1], f"the {what} itself", "not be overwritten"],
    )


def test_a_system_is_not_overwritten_by_its_page(folder):
    (folder / "page.html").write_bytes(b"")
    (folder / "own.toml").write_text(
        'system = "page.html"\n[inputs]\ncurrent = 0', encoding="utf-8"
    )
    refused(folder, "run", "own.toml", "--plot", "page.html", parts=["this is the system itself"])


def edited(path, target, edit):
    """Copy a result with something changed in it."""
    data = results.read(path)
    edit(data)
    results.write(data, target)
    return target


@pytest.fixture
def played(tmp_path):
    return played_record(tmp_path)


def test_what_is_not_the_same_is_said(played):
    works("run", "play.toml", "--out", "run.nc", cwd=played)

    def nudge(data):
        data.voltage.values[7] = np.nextafter(data.voltage.values[7], 1.0)

    edited(played / "run.nc", played / "nudged.nc", nudge)
    done = here("run", "nudged.nc", cwd=played)
    assert done.returncode == 1
    place = r"voltage differs by \d\.\d+e-1\d V at 0.7 s: "
    assert re.search(f"not as in nudged.nc: {place}", done.stdout)
    assert "displacement differs" not in done.stdout
    tolerance = ("--tolerance", "voltage=1nV", "--report", "page.html", "--junit", "verdicts.xml")
    assert "none of 4 signals differ" in works("run", "nudged.nc", *tolerance, cwd=played)
    assert "none of 4 signals differ" in (played / "page.html").read_text()
    (suite,) = JUnitXml.fromfile(str(played / "verdicts.xml"))
    assert (suite.tests, suite.failures) == (4, 0)
    # another experiment: nothing to compare
    changed = here("run", "nudged.nc", "--set", "R1=1", cwd=played)
    assert (changed.returncode, "not as in" in changed.stdout) == (0, False)


def test_another_build_of_the_fmu_is_warned_of(played):
    works("run", "play.toml", "--out", "run.nc", cwd=played)
    edited(
        played / "run.nc",
        played / "old.nc",
        lambda data: data.attrs.update(guids='{"ppy_actuator": "{0}"}'),
    )
    done = here("run", "old.nc", cwd=played)
    assert done.returncode == 0
    assert "warning: old.nc was made with another build of ppy_actuator ({0}, now {" in done.stderr
    assert "every value is the same" in done.stdout
