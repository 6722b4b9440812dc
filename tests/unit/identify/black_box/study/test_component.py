"""Claims: the component of a model runs as the filter that made the data, in both builds.

Names of columns and files become names that Python and FMI allow.
"""

from __future__ import annotations

import ast

import numpy as np
import pytest
from scipy.signal import lfilter

import orchestration as ppy
from fmus.kit import UserError
from fmus.kit.build.building import build_cached
from fmus.kit.record import CompiledModel
from orchestration.fmu.model import load_class
from orchestration.identify.black_box import (
    box_jenkins,
    input_output_data,
    output_error,
    state_space,
)
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
        assert result["signal_lambda"] == pytest.approx(expected, abs=1e-9), runtime


def exported(model, path, spreads=(1.0,)):
    units = dict.fromkeys((*model.input_names, model.output_name), "V")
    text = source(model, path.stem, units, "A model.", np.array(spreads))
    path.write_text(text, encoding="utf-8")
    return load_class(f"{path}:{class_name(path.stem)}")


def late_process(u, before):
    """Return the response of a pole of 0.9 and a gain of two to an input seven samples before."""
    whole = np.r_[np.full(300, before), u]
    return lfilter(np.r_[np.zeros(7), 0.2], [1.0, -0.9], whole)[300:]


@pytest.mark.parametrize("structure", ["OE", "SS"])
def test_what_a_delayed_input_was_before_the_start_is_one_state(tmp_path, structure):
    """Beside the process, whose input was another before the record begins."""
    rng = np.random.default_rng(2)
    u = np.repeat(rng.choice([1.0, 3.0], size=60), 10)
    y = late_process(u, u[0])
    data = input_output_data(u, y, STEP, ("u",), "y")
    found = output_error(data, 1, 1, 7) if structure == "OE" else state_space(data, 1, 7)
    cls = exported(found.model, tmp_path / f"late_{structure}.py")
    memory = {z.name for z in cls.layout.discretes if z.is_memory}
    starts = {p for z, p in cls.layout.start_of.items() if z not in memory}
    assert starts == {"u_before_start", "state_of_model_1_start"}

    time = STEP * np.arange(len(u))
    at_rest = CompiledModel(cls).run(time, {"u": u}, {}).signals["y"]
    assert at_rest == pytest.approx(y, abs=1e-6)

    # states at rest at another input: where they are after long at it
    settled = np.full(1000, u[0] - 2.0)
    settled[0] = u[0]
    states = CompiledModel(cls).run(STEP * np.arange(1000), {"u": settled}, {}).signals
    given = {"u_before_start": -2.0}
    given["state_of_model_1_start"] = states["state_of_model_1"][-1]
    later = CompiledModel(cls).run(time, {"u": u}, given).signals["y"]
    assert later == pytest.approx(late_process(u, u[0] - 2.0), abs=1e-6)


@pytest.mark.slow
def test_start_states_are_estimated_where_a_model_may_begin_anywhere(tmp_path):
    """At rest the run would begin at six volts, but the record does at two."""
    u = np.repeat(np.random.default_rng(3).choice([1.0, 3.0], size=60), 10)
    u[:10] = 3.0
    data = input_output_data(u, late_process(u, u[0]), STEP, ("u",), "y")
    path = tmp_path / "free.py"
    exported(output_error(data, 1, 1, 7).model, path)
    noise = 0.01 * np.random.default_rng(4).normal(size=len(u))
    columns = {"time [s]": STEP * np.arange(len(u)), "u [V]": u}
    record = columns | {"y [V]": late_process(u, 1.0) + noise}
    found = ppy.compare(record, f"{path}:Free")
    assert found.latest["y"].rms == pytest.approx(0.01, rel=0.1)
    (remark,) = found.remarks
    assert "start states are estimated from the record: u_before_start = -2" in remark
    fitted = ppy.fit(record, f"{path}:Free", ["y_mean"])
    assert fitted.values["u_before_start"] == pytest.approx(-2.0, abs=0.1)
    assert ppy.diagnose(record, f"{path}:Free", time=40.0).verdict == "consistent"


def test_an_estimated_operating_point_is_a_number_in_the_file(signals, tmp_path):
    """Its level is that of the filters that made the data, at the means of the inputs."""
    u, y = signals
    data = input_output_data(u, y + 3.0, STEP, ("drive", "load"), "y")
    model = box_jenkins(data, [2, 2], [1, 2], 0, 0, [0, 2]).model
    path = tmp_path / "model.py"
    path.write_text(
        source(model, "model", dict.fromkeys(("drive", "load", "y"), "V"), "A model.", np.ones(2))
    )
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
    units = dict.fromkeys((*columns, "Öffnung"), "V")
    path.write_text(source(model, "model", units, "A model.", np.ones(2)))
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
    assert identifiers(("u", "u_past")) == ["u", "u_past_"]
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
    text = source(found.model, "model", units, doc, np.ones(2))
    path = tmp_path / "model.py"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match="V"):
        load_class(f"{path}:Model")
    assert not (tmp_path / "ran").exists()
    assert ast.get_docstring(ast.parse(text), clean=False) == doc
