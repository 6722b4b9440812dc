"""Claims: a designed experiment is written as it is read, and says how surely it tells."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from orchestration.experiment.design import (
    DiscriminatingExperiment,
    ExpectedEvidence,
    Rehearsal,
    menu,
)
from orchestration.experiment.execution import run
from orchestration.experiment.reading import read

LEVELS = {"levels": [-1.0, 0.5], "dwell": [1.0, 2.0], "seed": 1}
EXPERIMENT = DiscriminatingExperiment(
    {
        "current": menu.Stimulus("multilevel", LEVELS),
        "force": menu.Stimulus("constant", {"value": 0.5}),
    },
    20.0,
    0.1,
    [ExpectedEvidence("one", "other", 30.0), ExpectedEvidence("one", "third", 4.0)],
    Rehearsal({"current": "A", "force": "N"}, ["voltage"], {"R1": 0.5}, ["double_layer"]),
    {"current": (-1.0, 0.5), "force": (0.5, 0.5)},
    {"one": 0.998, "other": 0.7},
)


def test_it_runs_as_it_is_written(tmp_path):
    path = tmp_path / "next.toml"
    path.write_text(EXPERIMENT.toml("ppy_actuator", "what for"), encoding="utf-8")
    result = run(read(str(path)))
    time = result.time.to_numpy()
    assert time == pytest.approx(0.1 * np.arange(201))
    assert np.array_equal(result["current"].to_numpy(), EXPERIMENT.stimuli["current"].values(time))
    assert {"effects", "parameters"} <= {*tomllib.loads(path.read_text(encoding="utf-8"))}


def test_it_says_what_is_expected_and_which_pair_stays():
    assert EXPERIMENT.sentence == (
        "With the experiment the true one of these is expected to have a probability of > 99 % if"
        " it is one, 70 % if it is other. It does not tell one from third."
    )
    alike = replace(EXPERIMENT, probabilities={"one": 0.998, "other": 0.999})
    assert "a probability of > 99 %, whichever it is." in alike.sentence
    text = EXPERIMENT.toml("ppy_actuator", "what for")
    assert "# If other is right, its probability should be 70 %." in text
    assert not EXPERIMENT.is_worthwhile
    assert EXPERIMENT.as_json()["reached"] == {"one": 0.998, "other": 0.7}
    by_bic = replace(EXPERIMENT, probabilities={})
    assert "reached" not in by_bic.as_json()
    assert by_bic.sentence.startswith("No experiment within these limits that was looked at tells")


def test_names_of_somebody_elses_fmu_are_read_as_they_are():
    """A dot begins a table in TOML, and a quote or the end of a line ends a text."""
    name, value = 'body.mass[1] "é"\n\\\x7f\x1b', 2.5e-7
    rehearsal = Rehearsal({name: "A"}, [name], {name: value}, [name])
    stimuli = {name: menu.Stimulus("multilevel", LEVELS)}
    limits = {name: (-1.0, 0.5)}
    odd = replace(EXPERIMENT, stimuli=stimuli, rehearsal=rehearsal, limits=limits)
    told = tomllib.loads(odd.toml(name, "two\nlines"))
    assert told["parameters"] == {name: value}
    assert told["inputs"][name] == LEVELS | {"kind": "multilevel", "levels": ["-1.0 A", "0.5 A"]}
    assert (told["component"], told["record"], told["effects"]) == (name, [name], [name])
