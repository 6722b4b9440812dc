"""Claims: the component of a model runs as the filter that made the data, in both builds.

Names of columns and files become names that Python and FMI allow.
"""

from __future__ import annotations

import ast

import numpy as np
import pytest
from scipy.signal import lfilter

from fmus.kit import UserError
from fmus.kit.build.building import build_cached
from orchestration.fmu.model import load_class
from orchestration.identify.black_box import box_jenkins, input_output_data
from orchestration.identify.black_box.study.component import class_name, identifiers, source
from tests.support.hosts import run_fmpy

STEP = 0.5


@pytest.mark.slow
def test_the_component_runs_as_the_filter_that_made_the_data(signals, found, tmp_path):
    """Free run of both builds in fmpy, beside SciPy with the identified coefficients."""
    path = found.export(tmp_path / "two_inputs.py")
    ast.parse(path.read_text(encoding="utf-8"))
    cls = load_class(f"{path}:TwoInputs")
    u, _ = signals
    model = found.model
    about = u - model.input_offsets
    expected = model.output_offset + sum(
        lfilter(model.b[i], model.f[i], about[:, i] - about[0, i])
        + about[0, i] * model.b[i].sum() / model.f[i].sum()
        for i in range(2)
    )
    time = STEP * np.arange(600)
    for runtime in ("native", "python"):
        fmu = build_cached(cls, runtime)
        result = run_fmpy(fmu, time, {"drive": u[:, 0], "signal_for": u[:, 1]}, ["signal_lambda"])
        settled = (
            np.arange(600) > 200
        )  # the component begins at rest at its operating point, not at the first inputs
        assert result["signal_lambda"][settled] == pytest.approx(expected[settled], abs=1e-9), (
            runtime
        )


def test_an_estimated_operating_point_is_a_number_in_the_file(signals, tmp_path):
    """Its level is that of the filters that made the data, at the means of the inputs."""
    u, y = signals
    data = input_output_data(u, y + 3.0, STEP, ("drive", "load"), "y")
    model = box_jenkins(data, [2, 2], [1, 2], 0, 0, [0, 2]).model
    path = tmp_path / "model.py"
    path.write_text(source(model, "model", dict.fromkeys(("drive", "load", "y"), "V"), "A model."))
    starts = {p.name: p.start for p in load_class(f"{path}:Model").layout.parameters}
    level = 3.0 + u.mean(axis=0) @ [0.9 / 0.2, 0.3 / 0.3]
    assert starts["y_mean"] == pytest.approx(level, abs=0.01)


def test_a_file_has_the_names_of_its_columns(signals, tmp_path):
    u, y = signals
    columns = ("Kühlung", "Kuehlung")
    model = box_jenkins(
        input_output_data(u, y, STEP, columns, "Öffnung"), [2, 2], [1, 2], 0, 0, [0, 2]
    ).model
    path = tmp_path / "model.py"
    path.write_text(source(model, "model", dict.fromkeys((*columns, "Öffnung"), "V"), "A model."))
    layout = load_class(f"{path}:Model").layout
    assert [(v.name, v.doc) for v in layout.inputs] == [
        ("Kuehlung", "input, column Kühlung"),
        ("Kuehlung_", "input, column Kuehlung"),
    ]
    (output,) = layout.outputs
    assert (output.name, output.doc) == (
        "Oeffnung",
        "Output of the identified model, column Öffnung",
    )


def test_names_of_columns_become_names_of_variables():
    assert identifiers(("drive", "U [cell]", "2nd", "for", "a b", "a_b", "name", "%")) == [
        "drive",
        "U__cell",
        "signal_2nd",
        "signal_for",
        "a_b",
        "a_b_",
        "name_",
        "signal",
    ]
    assert identifiers(("Kühlung", "Kuehlung", "Kuhlung")) == ["Kuehlung", "Kuehlung_", "Kuhlung"]
    assert identifiers(("u_mean", "u", "y", "y_mean")) == ["u_mean", "u_", "y", "y_mean_"]
    assert class_name("two_layer_wall") == "TwoLayerWall"


@pytest.mark.parametrize(
    ("stem", "name", "cls"),
    [
        ("1-x", "model_1_x", "Model1X"),
        ("wall 2", "wall_2", "Wall2"),
        ("class", "model_class", "ModelClass"),
        ("none", "model_none", "ModelNone"),
        ("é", "e", "E"),
        ("→", "model", "Model"),
        ("a.b", "a_b", "AB"),
    ],
)
def test_a_file_of_any_name_holds_a_class_that_is_built(found, tmp_path, stem, name, cls):
    path = found.export(tmp_path / f"{stem}.py")
    assert class_name(stem) == cls
    assert load_class(f"{path}:{cls}").name == name


def test_names_and_units_of_a_record_are_no_code(found, tmp_path):
    run = f"__import__('pathlib').Path({str(tmp_path / 'ran')!r}).touch()"
    doc = f'"""\n{run}\n"""\\'
    units = dict.fromkeys(found.columns.units, f'V"); {run}; ("')
    text = source(found.model, "model", units, doc)
    path = tmp_path / "model.py"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match="V"):
        load_class(f"{path}:Model")
    assert not (tmp_path / "ran").exists()
    assert ast.get_docstring(ast.parse(text), clean=False) == doc
