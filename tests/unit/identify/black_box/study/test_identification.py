"""Claims: columns of a file become a model, with figures, and mistakes are refused in a line.

Oracles: the filters that made the data, and published fits of a measured wall.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

import orchestration as ppy
from demonstrations.records import draw, write
from fmus.kit import UserError
from orchestration.identify.black_box.study.columns import read_columns
from tests.support.command import refused
from tests.support.pace import slow_but

STEP = 0.5


@pytest.mark.slow
def test_orders_and_poles_are_those_that_made_the_data(found):
    assert found.chosen.path_orders == (1, 2)
    assert found.model.poles("drive") == pytest.approx([0.8], abs=0.01)
    assert sorted(abs(found.model.poles("for"))) == pytest.approx([np.sqrt(0.5)] * 2, abs=0.02)
    assert found.chosen.validation_fit > 98.0
    assert found.excitation["drive"] > 10
    assert found.to_dict()["inputs"]["for"]["delay"] == 2
    assert found.residual_tests.passed


def test_the_figures_are_those_of_the_model_in_plain_json(found):
    figures = json.loads(json.dumps(found.to_dict()))
    assert figures["chosen"]["structure"] == "OE"
    assert figures["output"] == {"name": "lambda", "unit": "mm"}
    assert figures["chosen"]["parameters"]["f1_1"]["value"] == pytest.approx(-0.8, abs=0.01)
    assert figures["chosen"]["poles"]["drive"][0] == pytest.approx(
        [np.log(0.8) / STEP, 0.0], abs=0.03
    )


def test_doubts_come_first_and_stand_in_the_figures(found):
    """A search of the one row whose first parameter has no standard error."""
    row = found.chosen
    first, *others = row.identification.parameters
    open_ended = (replace(first, standard_error=np.inf), *others)
    doubtful = replace(row, identification=replace(row.identification, parameters=open_ended))
    result = replace(found, search=replace(found.search, rows=(doubtful,)))
    doubt = f"the record does not determine {first.name}"
    assert result.sentence.startswith(f"Doubtful: {doubt}. An OE model follows")
    assert result.to_dict()["chosen"]["doubts"] == [doubt]
    passing = replace(found, search=replace(found.search, rows=(replace(doubtful, bic=-99.0), row)))
    title = f"OE of order 1 2, {row.validation_fit:.1f} % on unseen data: {doubt}"
    assert passing.sentence == found.sentence
    assert passing.remarks == ["delays in samples: drive 0, for 2 (1 s)", f"passed over: {title}"]
    assert passing.to_dict()["passed_over"] == [title]


def step_test(bad=()):
    """Return a record of one step of a process, by its columns, with some readings of 850."""
    u = np.where(np.arange(400) > 60, 230.0, 0.0)
    y = 20.0 + lfilter(np.r_[np.zeros(9), 0.02], [1.0, -0.95], u)
    y += 0.05 * np.random.default_rng(5).normal(size=400)
    y[list(bad)] = 850.0
    return {"time [s]": np.arange(400.0), "heater [V]": u, "zone [degC]": y}


def test_bad_readings_are_named_and_change_nothing():
    options = {"structures": ["ARX"], "path_orders": [1], "noise_orders": [1], "delays": [9]}
    clean = ppy.black_box(step_test(), "zone", **options)
    found = ppy.black_box(step_test([150, 151, 230]), "zone", **options)
    assert found.columns.notes[-1] == (
        "zone, samples 150 to 151, 230 (the first is 0): far from what the inputs and the samples"
        " around say; left out as bad readings"
    )
    assert found.to_dict()["record"]["notes"] == [*found.columns.notes]
    assert found.model.a == pytest.approx(clean.model.a, abs=0.01)
    assert found.model.noise_variance == pytest.approx(clean.model.noise_variance, rel=0.2)


def test_many_samples_that_no_model_explains_are_kept_and_told():
    record = step_test()
    far = np.arange(20, 400, 20)
    record["zone [degC]"][far] += 40.0 * np.random.default_rng(1).choice([-1.0, 1.0], size=far.size)
    options = {"structures": ["ARX"], "path_orders": [1], "noise_orders": [1], "delays": [9]}
    found = ppy.black_box(record, "zone", **options)
    assert "of 400 samples are far from" in found.columns.notes[-1]
    assert (found.columns.data.output == record["zone [degC]"]).all()


def test_short_gaps_of_the_output_are_interpolated_and_long_ones_refused():
    options = {"structures": ["ARX"], "path_orders": [1], "noise_orders": [1], "delays": [9]}
    clean = ppy.black_box(step_test(), "zone", **options)
    record = step_test()
    record["zone [degC]"][[150, 151, 230]] = np.nan
    found = ppy.black_box(record, "zone", **options)
    said = "zone, samples 150 to 151, 230 (the first is 0): missing; interpolated"
    assert said in found.columns.notes
    assert found.model.a == pytest.approx(clean.model.a, abs=0.01)
    record["zone [degC]"][300:306] = np.nan
    with pytest.raises(UserError, match="zone, sample 300: is nan"):
        ppy.black_box(record, "zone", **options)


def test_unseen_data_in_which_nothing_moves_are_named(found):
    assert not any(line.startswith("no input moves") for line in found.remarks)
    options = {"structures": ["ARX"], "path_orders": [1], "noise_orders": [1], "delays": [9]}
    resting = ppy.black_box(step_test(), "zone", **options)
    assert resting.remarks[1].startswith("no input moves from sample 200 on")


@pytest.mark.slow
def test_a_model_of_the_circuit_is_preferred_to_degenerate_ones(tmp_path):
    """The delay of one sample, which the circuit does not have, leaves room for spare poles.

    The circuit has one pole, exp(-T / ((R1 + R2) C)), with the means of table 3-1.
    """
    write(draw(None, seed=1, duration=60.0), tmp_path / "record.csv")
    found = ppy.black_box(
        tmp_path / "record.csv",
        "voltage",
        ["current"],
        structures=["OE", "BJ"],
        path_orders=[2, 3],
        noise_orders=[2],
        delays=1,
    )
    assert found.search.passed_over
    model, parameters = found.model, found.chosen.identification.parameters
    assert np.isfinite([p.standard_error for p in parameters]).all()
    assert np.abs(model.output_offset) < 1.5  # V
    slowest = np.abs(model.poles()).max()
    assert slowest == pytest.approx(np.exp(-0.1 / ((0.43 + 2.35) * 2.7)), abs=5e-3)
    (other,) = found.search.ranked[1:]
    errors = [p.standard_error for p in other.identification.parameters]
    assert not np.isfinite(errors).all()
    assert f"Others: BJ {other.validation_fit:.1f} % (doubtful)." in found.sentence


def test_a_wall_that_counts_its_samples(public_data):
    path = public_data("two_layer_wall.csv")
    with pytest.raises(
        UserError, match=r"no column is a time, and the first, 'sample', is in 1; give the .*step="
    ):
        read_columns(path, "heat_flux")
    found = ppy.black_box(
        path, "heat_flux", step=1.0, structures=["BJ"], path_orders=[2], noise_orders=[2], delays=0
    )
    assert found.chosen.validation_fit >= 84.6
    assert found.estimation.input_names == ("internal_temperature", "external_temperature")


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["--output", "lamda"], ["no column 'lamda' (did you mean lambda"]),
        (["--output", "lambda", "--inputs", "drive,fro"], ["no column 'fro'"]),
        (["--output", "lambda", "--orders", "1,x"], ["--orders '1,x'", "whole numbers"]),
        (["--output", "lambda", "--orders", ","], ["--orders ','", "from 1 on"]),
        (["--output", "lambda", "--orders", "1,,2"], ["--orders '1,,2'"]),
        (["--output", "lambda", "--orders", "0"], ["--orders '0'", "from 1 on"]),
        (["--output", "lambda", "--noise-orders", ""], ["--noise-orders ''"]),
        (["--output", "lambda", "--delays", ","], ["--delays ','", "from 0 on"]),
        (["--output", "lambda", "--delays", "-1"], ["--delays '-1'", "from 0 on"]),
        (
            ["--output", "lambda", "--delays", "1,2,3"],
            ["delays = [1, 2, 3]", "one for each of 2 inputs"],
        ),
        (
            ["--output", "lambda", "--inputs", ","],
            ["--inputs ','", "nothing before or after a comma"],
        ),
        (
            ["--output", "lambda", "--structures", ","],
            ["--structures ','", "nothing before or after a comma"],
        ),
        (["--output", "lambda", "--structures", "ARXX"], ["structure ARXX: there is none"]),
        (["--output", "lambda", "--share", "1"], ["share = 1", "between 0 and 1"]),
        (["--output", "lambda", "--share", "nan"], ["share = nan: must be between 0 and 1"]),
        (
            ["--output", "lambda", "--share", "0.0001"],
            ["share = 0.0001 of 600 samples: both parts need samples"],
        ),
        (
            ["--output", "lambda", "--inputs", "drive,lambda"],
            ["lambda is an input and the output: name it once"],
        ),
        (
            ["--output", "lambda", "--inputs", "drive,drive"],
            ["--inputs 'drive,drive': drive is named twice"],
        ),
        (
            ["--output", "lambda", "--step", "1s"],
            ["the first column, 'time', is a time in s", "--step is for"],
        ),
        (["--output", "lambda", "--report", "a.txt"], [".html"]),
        (["--output", "lambda", "--out", "a.fmu"], [".py"]),
    ],
    ids=lambda value: " ".join(value),
)
def test_what_cannot_be_is_refused_in_a_line(file, arguments, parts):
    refused(file.parent, "black-box", file.name, *arguments, parts=parts)


def test_columns_that_there_are_are_told_once(file):
    with pytest.raises(
        UserError, match=r"no column 'nope' \(there are: time, drive, for, lambda\)$"
    ):
        read_columns(file, "nope")


@pytest.mark.slow
@pytest.mark.parametrize("samples", slow_but([40, 120, 190], 40))
def test_few_samples_are_tested_as_far_as_they_go(signals, tmp_path, samples):
    """Half of them estimate: of fewer than a hundred, 25 lags would be more than a quarter."""
    u, y = signals
    table = np.column_stack([STEP * np.arange(samples), u[:samples], y[:samples]])
    np.savetxt(
        tmp_path / "few.csv",
        table,
        delimiter=",",
        header="time [s],u [V],v [V],y [mm]",
        comments="",
    )
    found = ppy.black_box(
        tmp_path / "few.csv",
        "y",
        structures=["OE"],
        path_orders=[1],
        noise_orders=[1],
        delays=[0, 2],
    )
    residual = found.chosen.identification.residual
    assert len(found.residual_tests.autocorrelation) == 1 + len(residual) // 4
    assert "free running" in str(found)
    found.report(tmp_path / "few.html")


def test_delays_that_are_not_one_for_each_input_are_refused_at_once(file):
    with pytest.raises(UserError, match=r"delays = \[\]"):
        ppy.black_box(file, "lambda", delays=[])


def test_uneven_samples_are_refused(file, tmp_path):
    lines = file.read_text().splitlines()
    (tmp_path / "gap.csv").write_text("\n".join(lines[:300] + lines[303:]))
    refused(
        tmp_path,
        "black-box",
        "gap.csv",
        "--output",
        "lambda",
        parts=["gap.csv: samples are 0.5 s apart, but 2 s"],
    )
