"""Claims: any variable of anybody's FMU can be set, swept, recorded and read again, by its own
name, type and unit. An output of these FMUs is what was set.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas
import pytest

import orchestration as ppy
from fmus.kit.errors import UserError
from orchestration.fmu import find_model
from orchestration.records import read_record
from orchestration.system import Member, System
from orchestration.system.ssp import write
from tests.support.command import works
from tests.support.mirror import mirror, variable

MODE = (
    '<SimpleType name="Mode"><Enumeration><Item name="off" value="1"/><Item name="slow" value="3"/>'
    '<Item name="fast" value="7"/></Enumeration></SimpleType>'
)
SPEED = f'<BaseUnit rad="1" s="-1" factor="{math.pi / 30.0!r}"/>'
UNITS = (
    f'<Unit name="rev/min">{SPEED}</Unit><Unit name="1/min">{SPEED}</Unit>'
    '<Unit name="thumb"><BaseUnit m="1" factor="0.0254"/></Unit>'
    '<Unit name="K"><BaseUnit K="1"/><DisplayUnit name="degC" offset="-273.15"/></Unit>'
)
# type, its element, what is typed, what the FMU gets of it, what is refused and by which words
TYPES = {
    "mode": ('<Enumeration declaredType="Mode" start="1"/>', {"fast": 7.0, "3": 3.0}),
    "count": ('<Integer start="1" min="0" max="9"/>', {"9": 9.0, "2e0": 2.0}),
    "on": ('<Boolean start="false"/>', {"true": 1.0, "0": 0.0}),
    "n": ('<Real start="1" unit="rev/min"/>', {"3000rpm": 3000.0, "3.141592653589793rad/s": 30.0}),
    "m": ('<Real start="1" unit="1/min"/>', {"3000 rpm": 3000.0, "50 rev/s": 3000.0}),
    "size": ('<Real start="1" unit="thumb"/>', {"25.4mm": 1.0, "2": 2.0}),
    "rise": ('<Real start="1" unit="K" relativeQuantity="true"/>', {"5degC": 5.0, "5K": 5.0}),
    "T": ('<Real start="1" unit="K" displayUnit="degC"/>', {"5degC": 278.15, "9K": 9.0}),
    "bare": ('<Real start="1"/>', {"5": 5.0}),
}
REFUSED = {
    "mode=5": "5 is none of off (1), slow (3), fast (7)",
    "mode=turbo": "'turbo' is none of off (1)",
    "count=1.5": "1.5 is not a whole number",
    "count=10": "10 is out of range; allowed is 0 … 9",
    "on=2": "2 is neither true (1) nor false (0)",
    "n=5bananas": "unknown unit 'bananas'",
    "size=3s": "cannot be converted",
    "bare=5rad/s": "declares no unit of bare",
}


@pytest.fixture(scope="module")
def typed(tmp_path_factory) -> Path:
    parameters = [
        variable(name, k, "parameter", element)
        for k, (name, (element, _)) in enumerate(TYPES.items())
    ]
    outputs = [
        variable(f"{name}_out", 100 + k, "output", element.split(" start=")[0] + _rest(element))
        for k, (name, (element, _)) in enumerate(TYPES.items())
    ]
    return mirror(tmp_path_factory.mktemp("typed") / "typed.fmu", parameters + outputs, UNITS, MODE)


def _rest(element: str) -> str:
    """The element after its start value."""
    return element.split(" start=")[1].split('"', 2)[2] if " start=" in element else ""


def test_words_become_values_of_the_type_of_a_variable(typed):
    for name, (_, words) in TYPES.items():
        for word, value in words.items():
            done = ppy.simulate(str(typed), settings={name: word})
            assert done[f"{name}_out"][-1] == pytest.approx(value, rel=1e-12), (name, word)


def test_values_that_a_type_does_not_have_are_refused_in_a_line(typed):
    model = find_model(str(typed))
    for setting, words in REFUSED.items():
        with pytest.raises(UserError) as refusal:
            model.settings([setting])
        assert words in str(refusal.value)
        assert "\n" not in str(refusal.value)


def test_integers_booleans_and_enumerations_are_swept(typed):
    over = {"mode": "off, fast", "count": "1..3:3", "on": [0, 1]}
    swept = ppy.sweep(str(typed), over, keep=["last"])
    for name, values in {"mode": [1, 7], "count": [1, 2, 3], "on": [0, 1]}.items():
        assert swept[name].values.tolist() == values
        assert np.unique(swept[f"{name}_out_last"].values).tolist() == values
    for name, values, words in (
        ("mode", "1..3:3", "2 is none of off (1)"),
        ("count", "1..4:3", "2.5 is not a whole number"),
        ("count", "1..4", "list them"),
    ):
        with pytest.raises(UserError) as refusal:
            ppy.sweep(str(typed), {name: values})
        assert words in str(refusal.value)


def test_a_record_has_items_of_an_enumeration_by_name_or_number_and_no_others(typed, tmp_path):
    file = tmp_path / "modes.csv"
    head = "time [s],mode_out\n"
    file.write_text(head + "0,off\n0.1,7\n0.2,\n0.3,slow\n")
    record = ppy.read_record(str(file), model=str(typed))
    assert record.signals["mode_out"][[0, 1, 3]].tolist() == [1.0, 7.0, 3.0]
    for wrong in ("turbo", "2", "1.5"):
        file.write_text(f"{head}0,off\n0.1,{wrong}\n0.2,slow\n")
        with pytest.raises(UserError) as refusal:
            ppy.read_record(str(file), model=str(typed))
        words = f"row 3, column 'mode_out': '{wrong}' is none of off (1), slow (3), fast (7)"
        assert words in str(refusal.value)


WRONG_UNITS = (
    ({"n_out": "rpm"}, "n_out is declared in rev/min"),
    ({"nothing": "rpm"}, "has no variable named 'nothing'"),
)


def test_a_unit_declared_counts_in_sweeps(typed):
    swept = ppy.sweep(
        str(typed), {"bare": "60 rpm, 120 rpm"}, units={"bare": "rad/s"}, keep=["last"]
    )
    assert swept["bare_out_last"].values == pytest.approx([2.0 * math.pi, 4.0 * math.pi])
    for units, words in WRONG_UNITS:
        with pytest.raises(UserError, match=words):
            ppy.sweep(str(typed), {"bare": "1, 2"}, units=units)


def test_a_unit_declared_counts_in_fits(typed, tmp_path):
    file = tmp_path / "record.csv"
    file.write_text("time [s],bare_out [rpm]\n0,30\n0.1,60\n0.2,90\n")
    fitted = ppy.compare(
        str(file), str(typed), fit=["bare"], units={"bare": "rad/s", "bare_out": "rad/s"}
    )
    assert fitted.fit.values["bare"] == pytest.approx(2.0 * math.pi)
    for units, words in WRONG_UNITS:
        with pytest.raises(UserError, match=words):
            ppy.diagnose(str(file), model=str(typed), units=units)


def test_a_unit_that_an_fmu_does_not_declare_is_that_of_the_record_or_is_declared(typed, tmp_path):
    file = tmp_path / "record.csv"
    file.write_text("time [s],bare_out [rad/s],rise_out [degC]\n0,1,5\n0.1,2,6\n0.2,3,7\n")
    for units, values in (({}, [1, 2, 3]), ({"bare_out": "rpm"}, np.array([1, 2, 3]) * 30 / np.pi)):
        compared = ppy.compare(str(file), str(typed), units=units)
        assert compared.record.signals["bare_out"] == pytest.approx(values)
        assert compared.record.signals["rise_out"] == pytest.approx([5.0, 6.0, 7.0])
        notes = [repair.message for repair in compared.record.repairs]
        assert ("declares no unit of bare_out" in " ".join(notes)) == (not units)
    with pytest.raises(UserError, match="n_out is declared in rev/min"):
        ppy.compare(str(file), str(typed), units={"n_out": "rpm"})
    set_with_unit = ppy.simulate(str(typed), settings={"bare": "60 rpm"}, units={"bare": "rad/s"})
    assert set_with_unit["bare_out"][-1] == pytest.approx(2.0 * math.pi)


NAMES = ("u = 1", "u", "u = 1 = 2", "a,b", "a", "p[3]x", "'say \"hi\"'", "time", "x(y", "a;b")


def test_any_name_can_be_set_swept_chosen_and_is_read_again(tmp_path):
    variables = [variable(name, k, "input", '<Real start="0"/>') for k, name in enumerate(NAMES)]
    variables += [variable(f"{n}!", 100 + k, "output", "<Real/>") for k, n in enumerate(NAMES)]
    fmu = str(mirror(tmp_path / "names.fmu", variables))
    given = {name: float(k) for k, name in enumerate(NAMES, 1)}
    done = ppy.simulate(fmu, settings=given)
    assert {name: done[f"{name}!"][-1] for name in NAMES} == given
    model = find_model(fmu)
    assert model.settings(["u = 1=3", "u=2", "u=1=2=4"]) == {
        "u = 1": 3.0,
        "u": 2.0,
        "u = 1 = 2": 4.0,
    }
    assert [*model.recording(["a", "b!", "u!"]).outputs] == ["a,b!", "u!"]
    assert [*ppy.sweep(fmu, {"u = 1": "1, 2"}, outputs=["a,b!", "u = 1!"]).coords] == ["u = 1"]
    path = done.to_csv(tmp_path / "names.csv")
    units = {f"{name}!": "1" for name in NAMES}
    again = read_record(path, units)
    assert {name: again.signals[f"{name}!"][-1] for name in NAMES} == given


def test_texts_drive_an_fmu_and_are_recorded(tmp_path):
    text = "<String start='abc'/>"
    variables = [
        variable("u", 0, "input", '<Real start="1"/>'),
        variable("s", 1, "input", text),
        variable("u_out", 100, "output", "<Real/>"),
        variable("s_out", 101, "output", "<String/>"),
    ]
    fmu = str(mirror(tmp_path / "texts.fmu", variables))
    words = ["ein", "", 'quo"te, ½']
    done = ppy.simulate(fmu, {"s": words, "u": [1.0, 2.0, 3.0]}, time=[0.0, 0.1, 0.2])
    assert done["s_out"].tolist() == words
    assert done["u_out"].tolist() == [1.0, 2.0, 3.0]
    done.to_csv(tmp_path / "texts.csv")
    works("simulate", fmu, "--input", "texts.csv", "--out", "again.csv", cwd=tmp_path)
    first, again = (pandas.read_csv(tmp_path / f"{name}.csv") for name in ("texts", "again"))
    pandas.testing.assert_frame_equal(again[first.columns], first)
    constant = ppy.simulate(fmu, settings={"s": "all=one"})
    assert set(constant["s_out"]) == {"all=one"}


def test_locals_are_recorded_compared_set_and_fitted(tmp_path):
    real = '<Real start="2"/>'
    variables = [
        variable("u", 0, "input", '<Real start="1"/>'),
        variable("wall.T", 100, "local", "<Real/>", variability="continuous"),
        variable("T0", 1, "local", real, initial="exact"),
        variable("guess", 2, "local", real, initial="approx"),
        variable("inner", 3, "local", "<Real/>", initial="calculated"),
        variable("y", 101, "output", "<Real/>"),
        variable("z", 102, "output", "<Real/>"),
    ]
    fmu = str(mirror(tmp_path / "locals.fmu", variables))
    done = ppy.simulate(
        fmu, {"u": 5.0}, settings={"T0": 3.0, "guess": 4.0}, outputs=["wall.T", "T0"]
    )
    assert {name: values[-1] for name, values in done.outputs.items()} == {"wall.T": 5.0, "T0": 3.0}
    everything = ppy.simulate(fmu, outputs=["all"]).outputs
    assert [*everything] == ["y", "z", "wall.T", "T0", "guess", "inner", "u"]
    with pytest.raises(UserError, match="no parameter named 'inner'"):
        find_model(fmu).settings(["inner=3"])
    (tmp_path / "r.csv").write_text(
        "time [s],u [1],wall.T [1],y [1]\n0,1,1,7\n0.1,2,2,7.5\n0.2,3,3,6.5\n"
    )
    compared = ppy.compare(str(tmp_path / "r.csv"), fmu, fit=["T0"])
    assert compared.before["wall.T"].fit_percent == pytest.approx(100.0)
    assert compared.fit.values["T0"] == pytest.approx(7.0)


def test_names_with_equals_signs_are_set_in_a_system(tmp_path):
    names = ("u = 1", "u = 2", "u", "der(x[1,2])", "a,b")
    variables = [variable(n, k, "parameter", '<Real start="0"/>') for k, n in enumerate(names)]
    variables.append(variable("s", 50, "parameter", '<String start="abc"/>'))
    variables += [variable(f"{n}!", 100 + k, "output", "<Real/>") for k, n in enumerate(names)]
    mirror(tmp_path / "names.fmu", variables)
    system = System("named", (Member("m", tmp_path / "names.fmu"),), ())
    write(system, tmp_path / "named.ssp")
    given = {name: float(k) for k, name in enumerate(names, 3)}
    settings = {f"m.{name}": value for name, value in given.items()}
    more = {"m.s": "a=b", "duration": "0.2s"}
    done = ppy.run(str(tmp_path / "named.ssp"), settings=settings | more)
    assert {name: float(done[f"m.{name}!"][-1]) for name in names} == given
    with pytest.raises(UserError, match=r"no parameter named 'm\.v'"):
        ppy.run(str(tmp_path / "named.ssp"), settings={"m.v": "1=2", "duration": "0.2s"})
