"""Claims: what is clean is read as it is, to the edge of the doubles, in units of the model; public
records agree with a plain reading; files of twelve vendors are read without editing, and damaged
ones refused with file, row and reason.
"""

import os
import re
from pathlib import Path
from time import perf_counter

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.records import Source, parse_mapping, read_columns, read_record, read_samples
from tests.support import odd_tables, vendors
from tests.support.record_forms import write
from tests.support.record_rows import read, varied_rows, write_rows

PUBLIC = Path(os.environ.get("PPY_PUBLIC_DATA", Path(__file__).parents[4] / "shared" / "data"))


def test_a_clean_record_has_no_lines(tmp_path):
    record, kinds = read(write_rows(tmp_path, varied_rows(200)))
    assert kinds == {}
    assert record.time.size == 200


def test_values_at_the_edge_of_the_doubles_do_no_harm(tmp_path):
    record, _ = read(
        write_rows(
            tmp_path,
            [[k, (-1) ** k * 1.7e308, y] for k, _, y in varied_rows(100)] + [[1.7e308, 0, 0]],
        )
    )
    assert record.signals["u"][:2].tolist() == [1.7e308, -1.7e308]


def test_a_column_is_mapped_to_another_variable_with_an_equals_sign_in_its_name(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text("time [s],u,c\n0,1,2\n1,2,4\n2,3,6\n")
    mapping = parse_mapping(["c=a=b"])
    record = read_record(path, {"u": "1"}, mapping=mapping, others={"a=b": "1"})
    assert record.signals["a=b"].tolist() == [2.0, 4.0, 6.0]


def test_columns_are_read_under_their_own_names_in_their_own_units(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text("t [ms],i [mA],v [V],w\n0,1,2,3\n100,2,3,4\n200,1,2,3\n", encoding="utf-8")
    record = read_columns(path, ["i", "w"], ["i"])
    assert record.units == {"i": "mA", "w": "1"}
    assert record.time == pytest.approx([0.0, 0.1, 0.2])
    assert record.signals["i"].tolist() == [1.0, 2.0, 1.0]
    with pytest.raises(UserError, match=r"r.csv: no column 'x'.*t, i, v, w"):
        read_columns(path, ["x"])


@pytest.mark.parametrize(
    ("name", "signals", "mapping", "size", "kinds"),
    [
        (
            "creep_polyethylene_cm3.csv",
            {"force": "N", "displacement": "m"},
            {"stress": "force[N]", "strain": "displacement[m]"},
            279,
            {"unit replaced", "duplicates", "uneven sampling", "constant"},
        ),
        (
            "emps_positioning_stage.csv",
            {"position": "m", "motor_voltage": "V"},
            {},
            24841,
            {"ignored columns"},
        ),
        (
            "silverbox_snls80mV.csv",
            {"input": "V", "output": "V"},
            {},
            131072,
            {"rounded time"},
        ),
        (
            "supercapacitor_before_ageing_5mV_per_s.csv",
            {"voltage": "V", "current": "A"},
            {},
            24373,
            set(),
        ),
        (
            "supercapacitor_after_ageing_5mV_per_s.csv",
            {"voltage": "V", "current": "A"},
            {},
            24364,
            set(),
        ),
        (
            "two_layer_wall.csv",
            {"internal_temperature": "K", "external_temperature": "K", "heat_flux": "1"},
            {"sample": "time[s]"},
            1680,
            {"unit replaced"},
        ),
    ],
)
def test_public_records_agree_with_a_plain_reading(name, signals, mapping, size, kinds):
    path = PUBLIC / name
    if not path.exists():
        pytest.skip(f"public record {name} is not in {PUBLIC} (set PPY_PUBLIC_DATA)")
    record = read_record(path, signals, mapping=mapping, required=list(signals))
    assert record.time.size == size
    assert {repair.kind for repair in record.repairs} == kinds
    raw = np.genfromtxt(path, delimiter=",", names=True)
    plain = raw[raw.dtype.names[0]]
    rounding = 1e-5 if "rounded time" in kinds else 0.0
    np.testing.assert_allclose(record.time, np.unique(plain), rtol=0.0, atol=rounding)
    if "current" in signals:
        np.testing.assert_allclose(record.signals["current"], raw["current_mA"] / 1000, rtol=1e-14)
    if "displacement" in signals:
        means = [raw["strain_1"][plain == instant].mean() for instant in record.time]
        np.testing.assert_allclose(record.signals["displacement"], means, rtol=1e-9, atol=1e-18)
    if "heat_flux" in signals:
        np.testing.assert_allclose(
            record.signals["internal_temperature"], raw["internal_temperature_degC"] + 273.15
        )


def test_a_frequency_is_not_taken_for_an_angular_speed(tmp_path):
    path = write(tmp_path, "time [s],speed [Hz]\n0,1\n1,2\n")
    with pytest.raises(UserError, match="cannot be converted"):
        read_record(path, {"speed": "rad/s"})
    path = write(tmp_path, "time [s],speed [rpm]\n0,60\n1,30\n")
    np.testing.assert_allclose(
        read_record(path, {"speed": "rad/s"}).signals["speed"], [2 * np.pi, np.pi]
    )


def test_a_unit_in_a_name_is_asked_for_and_either_answer_works(tmp_path):
    path = write(tmp_path, "time [s],I_mA,phase_A\n0,1,1\n1,2,2\n")
    with pytest.raises(UserError, match=r"name ends in mA: .*current\[mA\].* or .*current\[A\]"):
        read_record(path, {"current": "A"}, mapping={"I_mA": "current"})
    for unit, factor in (("mA", 1e-3), ("A", 1.0)):
        record = read_record(path, {"current": "A"}, mapping={"I_mA": f"current[{unit}]"})
        np.testing.assert_allclose(record.signals["current"], factor * np.array([1.0, 2.0]))
    assert read_record(path, {"current": "A"}, mapping={"phase_A": "current"}).time.size == 2


@pytest.mark.parametrize("vendor", vendors.VENDORS, ids=lambda make: make.__name__)
def test_a_file_of_a_vendor_is_read_as_it_is(tmp_path, vendor):
    file = vendor()
    record = read_vendor(tmp_path, file)
    samples = vendors.course()
    since = record.time - record.time[0]
    np.testing.assert_allclose(since, [float(s.time) for s in samples], rtol=1e-12, atol=1e-9)
    for name in vendors.UNITS:
        truth = [float(getattr(sample, name)) for sample in samples]
        np.testing.assert_allclose(record.signals[name], truth, rtol=1e-14)
    assert not any(repair.changed_data for repair in record.repairs)


@pytest.mark.parametrize("vendor", vendors.VENDORS, ids=lambda make: make.__name__)
def test_a_damaged_file_of_a_vendor_is_refused_with_file_row_and_reason(tmp_path, vendor):
    damaged = vendors.damages(vendor())
    assert len(damaged) == 5
    for damage in damaged:
        began = perf_counter()
        with pytest.raises(UserError) as caught:
            read_vendor(tmp_path, damage.file)
        assert perf_counter() - began < 2.0
        message = str(caught.value)
        assert message.startswith(str(tmp_path / damage.file.name)), damage.what
        assert re.search(rf"\brows? {damage.line}\b", message), (damage.what, message)
        assert damage.reason in message, damage.what
        assert "\n" not in message


@pytest.mark.parametrize("table", odd_tables.all_tables(), ids=lambda table: table.name)
def test_an_odd_table_is_read_as_it_is_or_asks_for_what_settles_it(tmp_path, table):
    path = write(tmp_path, table.content, table.name)
    if table.asks:
        with pytest.raises(UserError) as caught:
            read_record(path, odd_tables.UNITS)
        assert str(caught.value).startswith(str(path))
        assert table.asks in str(caught.value)
    source = Source.of(path, **table.reading)
    record = read_record(source, odd_tables.UNITS, mapping=table.mapping, required=["voltage"])
    np.testing.assert_allclose(record.time - record.time[0], table.time, rtol=1e-9, atol=1e-4)
    np.testing.assert_allclose(record.signals["current"], table.current, rtol=1e-14, atol=1e-16)
    np.testing.assert_allclose(record.signals["voltage"], table.voltage, rtol=1e-14)
    said = " ".join(repair.message for repair in record.repairs)
    for words in table.says:
        assert words in said


def read_vendor(folder, file):
    path = folder / file.name
    path.write_bytes(file.content())
    return read_record(
        path,
        vendors.UNITS,
        mapping=parse_mapping(file.mapping),
        required=list(vendors.UNITS),
        inputs=["current"],
    )


def test_samples_are_read_as_they_stand(tmp_path):
    """Jumps, gaps and order stay; words are left out and noted."""
    path = tmp_path / "result.csv"
    path.write_text("time [s],u [mV],x,mode\n0,1,5,on\n1,2,6,on\n1,3,,off\n0.5,4,8,off\n")
    record = read_samples(path)
    assert record.time.tolist() == [0.0, 1.0, 1.0, 0.5]
    assert record.signals["u"].tolist() == [1.0, 2.0, 3.0, 4.0]
    assert np.isnan(record.signals["x"]).tolist() == [False, False, True, False]
    assert (record.units["u"], record.units["x"]) == ("mV", "")
    assert list(record.signals) == ["u", "x"]
    notes = [repair.message for repair in record.repairs]
    assert any("mode" in note and note.startswith("left out") for note in notes)
    assert "no unit is stated for x" in notes
