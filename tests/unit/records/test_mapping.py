"""Claims: a column is a signal by its name, by what the user says, or by its name behind that of a
system's member, where that is clear.
"""

from __future__ import annotations

import shlex

import numpy as np
import pytest

from fmus.kit.errors import UserError
from orchestration.records import parse_mapping, read_record, write_record
from orchestration.reporting import in_shell
from tests.support.record_forms import PLAIN, SIGNALS, refusal, write

TIME = 0.1 * np.arange(50)
OF_MEMBER = {"current": "A", "voltage": "V"}


@pytest.fixture
def written(tmp_path):
    def write(*names):
        values = {name: np.sin((k + 1.0) * TIME) for k, name in enumerate(names)}
        write_record(tmp_path / "r.csv", TIME, values, dict.fromkeys(names, "V") | {"current": "A"})
        return tmp_path / "r.csv", values

    return write


def test_the_only_column_of_a_member_is_taken_and_told(written):
    path, values = written("current", "proxy.voltage", "proxy.voltage_age")
    record = read_record(path, OF_MEMBER)
    assert record.signals["voltage"] == pytest.approx(values["proxy.voltage"])
    messages = [repair.message for repair in record.repairs if not repair.changed_data]
    assert (
        "column 'proxy.voltage' is read as voltage: the only one of a member of this name"
        in messages
    )


def test_a_name_with_spaces_is_that_of_a_model_which_writes_none(written):
    path, values = written("current", "Zone 3")
    record = read_record(path, {"current": "A", "Zone_3": "V"})
    assert record.signals["Zone_3"] == pytest.approx(values["Zone 3"])
    assert any("'Zone 3' is read as Zone_3" in repair.message for repair in record.repairs)


def test_two_names_that_are_written_alike_are_left_to_the_user(written):
    path, _ = written("current", "Zone 3", "Zone.3")
    assert set(read_record(path, {"current": "A", "Zone_3": "V"}).signals) == {"current"}


def test_a_column_of_the_very_name_goes_first(written):
    path, values = written("current", "proxy.voltage", "voltage")
    assert read_record(path, OF_MEMBER).signals["voltage"] == pytest.approx(values["voltage"])


def test_what_the_user_says_goes_first(written):
    path, values = written("current", "proxy.voltage", "cell")
    record = read_record(path, OF_MEMBER, mapping={"cell": "voltage"})
    assert record.signals["voltage"] == pytest.approx(values["cell"])


def test_two_members_are_no_choice_for_a_program_to_make(written):
    path, _ = written("current", "one.voltage", "two.voltage")
    assert list(read_record(path, OF_MEMBER).signals) == ["current"]
    with pytest.raises(UserError, match="the signal 'voltage'"):
        read_record(path, OF_MEMBER, required=["voltage"])


def test_mapping_renames_and_reinterprets(tmp_path):
    path = write(tmp_path, "t [s],stress [Pa],strain [1],I\n0,10,1e-3,0.1\n1,10,2e-3,0.2\n")
    mapping = parse_mapping(["strain=displacement[mm]", "I=current", "stress [Pa] = force [N]"])
    assert mapping == {"strain": "displacement[mm]", "I": "current", "stress [Pa]": "force [N]"}
    record = read_record(path, {**SIGNALS, "force": "N"}, mapping=mapping)
    np.testing.assert_allclose(record.signals["displacement"], [1e-6, 2e-6])
    np.testing.assert_allclose(record.signals["force"], [10, 10])
    kinds = [r.kind for r in record.repairs]
    assert kinds.count("unit replaced") == 2
    assert kinds.count("unit assumed") == 1


@pytest.mark.parametrize(
    ("column", "signal"),
    [
        ("a=b", "der(x[1,2])"),
        ("a=b", "x[1].y"),
        ("a", "k=1"),
        ("a=b", "u = 1"),
        ("a = b", "u = 1 = 2"),
        ('say "a,b"', "p[3] = 'c,d'"),
    ],
)
@pytest.mark.parametrize(("unit", "factor"), [("", 1.0), ("[mm]", 1e-3)])
def test_names_with_brackets_commas_and_equals_signs_are_mapped(
    tmp_path, column, signal, unit, factor
):
    quoted = column.replace('"', '""')
    path = write(tmp_path, f'time [s],"{quoted}"\n0,5\n1,6\n')
    mapping = parse_mapping([f"{column}={signal}{unit}"])
    record = read_record(path, {"b": "m", "1": "m", "2": "m", signal: "m"}, mapping=mapping)
    np.testing.assert_allclose(record.signals[signal], [5.0 * factor, 6.0 * factor])
    assert [*record.signals] == [signal]


def test_an_explicit_mapping_wins_over_an_equal_name(tmp_path):
    path = write(tmp_path, "time [s],current [A],current_2 [A]\n0,1,5\n1,2,6\n")
    record = read_record(path, SIGNALS, mapping={"current_2": "current"})
    assert record.signals["current"].tolist() == [5, 6]
    assert "'current'" in record.repairs[0].message


@pytest.mark.parametrize("entry", ["strain", "=x", "a=", "a=b[m", "a=b]m[", "a=[m]"])
def test_a_malformed_mapping_is_refused(entry):
    with pytest.raises(UserError, match="the form is file_column=signal"):
        parse_mapping([entry])


@pytest.mark.parametrize("entries", [["a=x", "a=y"], ["a=x", "b=x[m]"]])
def test_mapping_twice_is_refused(entries):
    with pytest.raises(UserError, match="mapped twice"):
        parse_mapping(entries)


def test_mapping_to_or_from_what_is_not_there_is_refused_with_a_suggestion(tmp_path):
    path = write(tmp_path, PLAIN)
    assert "did you mean current?" in refusal(path, mapping={"curent": "displacement"})
    assert "did you mean displacement?" in refusal(path, mapping={"current": "displacment"})


def test_a_required_signal_that_is_absent_is_refused_with_a_suggestion(tmp_path):
    path = write(tmp_path, "time [s],Displacement [m],current [A]\n0,1,2\n1,2,3\n")
    message = refusal(path, required=["displacement"])
    assert "did you mean Displacement?" in message
    assert "mapping={" in message


@pytest.mark.parametrize("required", [(), ("displacement",)])
def test_the_map_that_a_refusal_advises_works_word_for_word(tmp_path, required):
    path = write(tmp_path, "time [s],Strom [mA],Weg [mm],n\n0,100,1,7\n1,200,2,8\n")
    with in_shell():
        message = refusal(path, required=required)
    words = shlex.split(message[message.index("--map") :])
    assert words[::2] == ["--map", "--map"]
    record = read_record(path, SIGNALS, mapping=parse_mapping(words[1::2]), required=required)
    np.testing.assert_allclose(record.signals["displacement"], [1e-3, 2e-3])
    np.testing.assert_allclose(record.signals["current"], [0.1, 0.2])


def test_columns_without_a_clear_signal_are_named_with_those_that_they_may_be(tmp_path):
    path = write(tmp_path, "t [s],Strom [mA],U_cell [V],spring,pull\n0,1,2,3,4\n1,2,3,4,5\n")
    signals = {"current": "A", "voltage": "V", "voltage_margin": "V", "load": "N"}
    with pytest.raises(UserError) as refused:
        read_record(path, signals)
    advice = str(refused.value).partition("; probably: ")[2].split("; ")
    assert "Strom" in advice[0]
    assert advice[1:] == [
        "'U_cell' may be voltage or voltage_margin",
        "'spring' may be any",
        "'pull' may be any",
    ]


@pytest.mark.parametrize("unit", ["blorg", "V"])
def test_the_map_that_states_a_unit_works_word_for_word(tmp_path, unit):
    path = write(tmp_path, f"time [s],current [{unit}]\n0,1\n1,2\n")
    with in_shell():
        message = refusal(path)
    words = shlex.split(message[message.index("--map") :])
    record = read_record(path, SIGNALS, mapping=parse_mapping(words[1::2]))
    assert record.signals["current"].tolist() == [1.0, 2.0]


def test_a_column_is_found_by_its_whole_header(tmp_path):
    path = write(tmp_path, "time/s,I/mA,I/A\n0,5,1\n1,6,2\n")
    record = read_record(path, SIGNALS, mapping=parse_mapping(["I/A=current"]))
    assert record.signals["current"].tolist() == [1.0, 2.0]


ELEMENTS = {"u[1]": "A", "u[2]": "A", "A[2,1]": "1"}


@pytest.mark.parametrize("units", [True, False])
def test_columns_of_elements_of_arrays_have_their_indices(tmp_path, units):
    values = {name: np.sin((k + 1.0) * TIME) for k, name in enumerate(ELEMENTS)}
    path = tmp_path / "r.csv"
    write_record(path, TIME, values, ELEMENTS)
    if not units:
        header = '"time","u[1]","u[2]","A[2,1]"'
        path.write_text("\n".join([header, *path.read_text().splitlines()[1:], ""]))
    record = read_record(path, ELEMENTS)
    for name, expected in values.items():
        np.testing.assert_array_equal(record.signals[name], expected)


def test_columns_are_mapped_to_elements_of_arrays(tmp_path):
    values = {name: np.sin((k + 1.0) * TIME) for k, name in enumerate(("a", "b", "c"))}
    write_record(tmp_path / "r.csv", TIME, values, {"a": "A", "b": "1", "c": "1"})
    mapping = parse_mapping(["a=u[1]", "b=u[2] [mA]", "c=A[2,1]"])
    record = read_record(tmp_path / "r.csv", ELEMENTS, mapping=mapping)
    np.testing.assert_array_equal(record.signals["A[2,1]"], values["c"])
    np.testing.assert_allclose(record.signals["u[2]"], 1e-3 * values["b"])


def test_an_ignored_column_without_a_name_is_called_so(tmp_path):
    path = write(tmp_path, '"",time [s],current [A]\n1,0,1\n2,1,2\n3,2,4\n')
    (said,) = (r for r in read_record(path, {"current": "A"}).repairs if "ignored" in r.kind)
    assert said.message.endswith("so ignored: a column without a name")
