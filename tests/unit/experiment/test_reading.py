"""Claims: an experiment is read from its file, by its name or out of a result, and
settings go over it.
"""

import json
import shutil

import pytest

from orchestration.experiment import results
from orchestration.experiment.reading import read
from tests.support.command import refused, works
from tests.support.experiments import PLAYED, played_record


@pytest.mark.parametrize(
    ("settings", "look", "value"),
    [
        (["duration=500 ms"], lambda e: e.duration, 0.5),
        (["R1=610mohm"], lambda e: e.parameters["R1"], "610mohm"),
        (["parameters.R1=0.61"], lambda e: e.parameters["R1"], 0.61),
        (["bench.mass=30g"], lambda e: e.parameters["bench.mass"], "30g"),
        (["inputs.current.amplitude=0.5A"], lambda e: e.inputs["current"].amplitude, (0.5, "A")),
        (["inputs.current=2"], lambda e: e.inputs["current"].value, (2.0, "")),
        (["inputs.bench.current=2"], lambda e: e.inputs["bench.current"].value, (2.0, "")),
        (["noise.a.voltage.rms=1mV"], lambda e: e.noise["a.voltage"].rms, (1.0, "mV")),
        (['record=["charge"]'], lambda e: e.record, ["charge"]),
        (["duration=1", "duration=2"], lambda e: e.duration, 2.0),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_settings_go_over_the_file(settings, look, value):
    assert look(read("fig_3_4", settings)) == value


@pytest.fixture
def folder(tmp_path):
    return played_record(tmp_path)


def edited(path, target, edit, upto=None):
    """Copy a result, or its beginning, with something changed in it."""
    data = results.read(path).isel(time=slice(upto))
    edit(data)
    results.write(data, target)
    return target


@pytest.mark.slow
def test_a_result_of_an_fmu_is_made_again_as_that_is(fmu, tmp_path):
    """A result names a build whatever it was made on; an FMU has one, which was not chosen."""
    (tmp_path / "x.fmu").write_bytes(fmu("galvanostat", "python").read_bytes())
    (tmp_path / "x.toml").write_text('component = "x.fmu"\nduration = 1\n', encoding="utf-8")
    works("run", "x.toml", "--out", "x.nc", cwd=tmp_path)
    assert "runtime" in json.loads(results.read(tmp_path / "x.nc").attrs["experiment"])
    assert "the same to the last bit" in works("run", "x.nc", cwd=tmp_path)
    for given in ("x.toml", "x.nc"):
        refused(tmp_path, "run", given, "--runtime", "python", parts=["x.fmu is taken as it is"])


@pytest.mark.slow
def test_a_result_finds_its_system_where_both_were_moved_to(tmp_path):
    """Beside it, or below; and beside it when it was made elsewhere and the system has come after
    it.
    """
    home, other = tmp_path / "home", tmp_path / "other"
    (home / "systems").mkdir(parents=True)
    works("system", "export", "dma_bench", "--out", "systems/bench.ssp", cwd=home)
    text = (
        'system = "systems/bench.ssp"\nduration = 0.01\n[inputs]\nforce_reference = 1\ncurrent'
        " = 0\n"
    )
    (home / "bench.toml").write_text(text, encoding="utf-8")
    works("run", "bench.toml", "--out", "near.nc", cwd=home)
    works("run", "bench.toml", "--out", "../far/far.nc", cwd=home)
    assert (
        json.loads(results.read(home / "near.nc").attrs["experiment"])["system"]
        == "systems/bench.ssp"
    )
    home.rename(other)
    assert "every value is the same" in works("run", "other/near.nc", cwd=tmp_path)
    refused(tmp_path, "run", "far/far.nc", parts=["bench.ssp"])
    shutil.copy(other / "systems" / "bench.ssp", tmp_path / "far")
    assert "every value is the same" in works("run", "far/far.nc", cwd=tmp_path)


def test_a_mark_at_the_beginning_of_a_file_is_no_part_of_it(folder):
    (folder / "marked.toml").write_text(PLAYED, encoding="utf-8-sig")
    assert read(str(folder / "marked.toml")) == read(str(folder / "play.toml"))
