"""Claims: a value is read as it is written on the command line, or refused with its flag."""

from __future__ import annotations

import pytest

from fmus.kit import UserError
from orchestration.api.declaration import (
    options_of,
)
from orchestration.api.forms import (
    PARAMETERS,
    SETTINGS,
    comma_list,
    given_names,
    names_among,
    numbers,
    optional_seconds,
    percent,
    seconds,
)
from orchestration.api.options import (
    DiagnoseOptions,
    StudyOptions,
)


def test_words_are_read_back_to_the_value():
    given = {
        "hold": ["a", "b"],
        "effects": [],
        "mapping": {"u": "voltage[mV]"},
        "settings": {"k1": "6 N/mm"},
    }
    options = options_of(DiagnoseOptions)
    for name, value in given.items():
        _, *typed = options[name].words(value)
        listed = options[name].form.typed == list[str] | None
        assert options[name].read(typed if listed else typed[0]) == value
    for time in (60.0, 1e-3, float("inf")):
        assert seconds(options["time"].words(time)[1]) == time


@pytest.mark.parametrize(
    ("given", "expected"),
    [("10s", 10.0), ("250 ms", 0.25), ("2min", 120.0), ("7", 7.0), (3, 3.0), ("inf", float("inf"))],
)
def test_a_time_in_python_is_a_number_or_a_text(given, expected):
    assert seconds(given) == optional_seconds(given) == pytest.approx(expected)
    assert options_of(DiagnoseOptions)["time"].words(given)[1] == (
        "inf" if given == "inf" else f"{expected:g}s"
    )


def test_what_is_no_time_is_refused():
    assert optional_seconds(None) is None
    for text in ("soon", "10 kg"):
        with pytest.raises(UserError, match=text):
            seconds(text)


def test_one_name_stands_for_a_list_of_names():
    assert given_names("R1", "fit =") == ["R1"]
    assert given_names("R1, C", "fit =") == ["R1", "C"]
    assert given_names(("R1", "C"), "fit =") == ["R1", "C"]
    with pytest.raises(UserError, match="fit = 'R1,': there is nothing"):
        given_names("R1,", "fit =")
    effects = options_of(DiagnoseOptions)["effects"]
    assert effects.given("diffusion") == ["diffusion"]
    assert effects.given("none") == effects.given([]) == []
    assert effects.given(None) is None


def test_the_orders_of_a_study_are_read_as_they_are_written():
    options = options_of(StudyOptions)
    assert options["delays"].read(options["delays"].form.write(1)[0]) == 1
    assert options["delays"].read(options["delays"].form.write([0, 2])[0]) == [0, 2]
    for name in ("structures", "path_orders", "noise_orders"):
        (text,) = options[name].form.write(options[name].default)
        assert tuple(options[name].read(text)) == options[name].default


@pytest.mark.parametrize("text", ["", " ", "a,,b", "a,", ",a", " , ", "a,b,a", "a, a"])
def test_a_list_is_taken_literally(text):
    with pytest.raises(UserError, match="--fit"):
        comma_list(text, "--fit")
    assert comma_list(" a , b", "--fit") == ["a", "b"]
    assert comma_list("thermal_node(loss, room), b", "--fit") == ["thermal_node(loss, room)", "b"]
    listed = "k,A[1,2], gain(M[2,1], u)"
    assert comma_list(listed, "--fit") == ["k", "A[1,2]", "gain(M[2,1], u)"]


@pytest.mark.parametrize("text", ["", "1,", "1.5", "-1", "one"])
def test_numbers_are_whole_and_large_enough(text):
    with pytest.raises(UserError, match=r"--delays .*: write whole numbers from 0 on"):
        numbers(0).read(text, "--delays")
    assert numbers(0).read("0, 2", "--delays") == [0, 2]


def test_numbers_are_given_as_they_are_or_as_in_a_shell():
    form = numbers(1)
    assert form.given("1, 2", "path_orders =") == form.given((1, 2), "path_orders =") == [1, 2]
    assert form.given(2, "path_orders =") == [2]
    with pytest.raises(UserError, match=r"^path_orders = 'one': write whole numbers from 1 on"):
        form.given("one", "path_orders =")


def test_a_share_is_written_with_its_sign_or_without():
    assert percent("95%") == percent("95 %") == percent(" 95") == 95.0
    for text in ("0%", "101%", "much", "nan", "-5%", ""):
        with pytest.raises(ValueError, match="such as 95%"):
            percent(text)


def test_names_are_those_that_are_known():
    form = names_among(("dry", "wet"))
    assert form.read("wet, dry", "--require") == ["wet", "dry"]
    with pytest.raises(UserError, match="--require damp: there are dry, wet"):
        form.read("wet,damp", "--require")
    with pytest.raises(UserError, match="--require '': there are dry, wet"):
        form.read("", "--require")


def test_a_setting_is_given_once():
    with pytest.raises(UserError, match="--set R1=2: R1 has a value already"):
        SETTINGS.read(["R1=1", "C=3", "R1=2"], "--set")


SPECIMEN = """model = "ppy_actuator"
[parameters]
R1 = 0.5
k1 = "5.5 N/mm"
"""


def test_a_file_of_parameters_stands_for_its_settings(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "film.toml").write_text(SPECIMEN)
    assert PARAMETERS.read(["film.toml"], "--set") == {"R1": "0.5", "k1": "5.5 N/mm"}
    in_system = {"actuator.R1": "0.5", "actuator.k1": "5.5 N/mm", "stop": "1s"}
    assert PARAMETERS.read(["actuator@film.toml", "stop=1s"], "--set") == in_system
    assert PARAMETERS.given("film.toml", "settings =") == {"R1": "0.5", "k1": "5.5 N/mm"}
    assert PARAMETERS.given({"R1": 1.0}, "settings =") == {"R1": 1.0}


SET = """<ssv:ParameterSet version="1.0" name="film"
 xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"><ssv:Parameters>
  <ssv:Parameter name="R1"><ssv:Real value="0.5" unit="ohm"/></ssv:Parameter>
  <ssv:Parameter name="share"><ssv:Real value="0.25" unit="1"/></ssv:Parameter>
  <ssv:Parameter name="kind"><ssv:String value="slow"/></ssv:Parameter>
</ssv:Parameters></ssv:ParameterSet>"""


def test_so_does_a_parameter_set(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "film.ssv").write_text(SET)
    values = {"R1": "0.5 ohm", "share": "0.25", "kind": "slow"}
    assert PARAMETERS.read(["film.ssv"], "--set") == values
    assert PARAMETERS.read(["film.ssv", "R1=2"], "--set") == values | {"R1": "2"}
    assert PARAMETERS.read(["a@film.ssv"], "--set")["a.R1"] == "0.5 ohm"


@pytest.mark.parametrize("words", [["R1=2", "film.toml"], ["film.toml", "R1=2"]])
def test_a_setting_that_is_typed_overrides_that_of_a_file(words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "film.toml").write_text(SPECIMEN)
    assert PARAMETERS.read(words, "--set") == {"R1": "2", "k1": "5.5 N/mm"}


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("film.toml", "[values]\n", "a file of parameters has a table [parameters]"),
        ("film.toml", "[parameters]\nR1 = [1]\n", 'R1 = [1]: write a number or "number unit"'),
        ("film.toml", "[parameters]\nR1 = true\n", "R1 = True: write a number"),
        ("film.toml", "[parameters\n", "expected ']'"),
        ("film.toml", None, "cannot be read"),
        ("film.ssv", SET.replace('value="0.5"', ""), "parameter 'R1' has no single value"),
        ("film.ssv", SET.replace("ssv:Parameter ", "ssv:Other "), "not well-formed"),
        ("film.ssv", "<a/>", "holds no parameter of a parameter set"),
        ("film.ssv", '<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "the XML "),
        ("film.ssv", None, "cannot be read"),
    ],
)
def test_a_file_without_parameters_is_refused_with_its_name(
    name, text, said, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(UserError, match=rf"^{name}: ") as refused:
        PARAMETERS.read([name], "--set")
    assert said in str(refused.value)
