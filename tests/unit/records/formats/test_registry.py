"""Claims: every file form gives the same record; what is no record is refused in one line that says
what and where.
"""

import builtins
import os
from pathlib import Path

import numpy as np
import pytest

from fmus.kit.errors import UserError
from orchestration.records import parse_mapping, read_record

SIGNALS = {"current": "A", "displacement": "m"}
TIME = np.array([0.0, 0.5, 1.0, 1.5])
CURRENT = np.array([0.1, -0.2, 0.3, 0.4])
DISPLACEMENT = np.array([1e-3, 2e-3, 4e-3, 3e-3])


def write(folder, text, name="record.csv"):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def check(record):
    np.testing.assert_allclose(record.time, TIME, rtol=1e-15)
    np.testing.assert_allclose(record.signals["current"], CURRENT, rtol=1e-14)
    np.testing.assert_allclose(record.signals["displacement"], DISPLACEMENT, rtol=1e-14)
    assert record.units == SIGNALS


def refusal(path, signals=SIGNALS, **options):
    with pytest.raises(UserError) as caught:
        read_record(path, signals, **options)
    message = str(caught.value)
    assert "\n" not in message
    return message


PLAIN = (
    "time [s],current [A],displacement [m]\n0,0.1,1e-3\n0.5,-0.2,2e-3\n1,0.3,4e-3\n1.5,0.4,3e-3\n"
)


@pytest.mark.parametrize(
    "text",
    [
        PLAIN,
        PLAIN.replace("\n", "\r\n"),
        "\ufeff" + PLAIN,
        PLAIN.encode("utf-16"),
        "# made by hand\n\n# second comment, with a comma\n" + PLAIN,
        PLAIN.replace(",", "\t"),
        PLAIN.replace(",", ";"),
        PLAIN.replace(",", ";").replace(".", ","),
        PLAIN.replace(",", "\t").replace(".", ","),
        (
            '"time [s]","current [A]","displacement'
            ' [m]"\n"0","0.1","1e-3"\n0.5,-0.2,2e-3\n1,0.3,4e-3\n1.5,0.4,3e-3\n'
        ),
        PLAIN.replace("\n", ",\n"),
        "time [ms],displacement [mm],current [mA]\n0,1,100\n500,2,-200\n1000,4,300\n1500,3,400\n",
        (
            "time [min],displacement [µm],current [kA]\n0,1000,1e-4\n"
            f"{0.5 / 60!r},2000,-2e-4\n{1 / 60!r},4000,3e-4\n{1.5 / 60!r},3000,4e-4\n"
        ),
        (
            "current [A],note,time [s],displacement"
            " [m]\n0.1,start,0,1e-3\n-0.2,,0.5,2e-3\n0.3,x,1,4e-3\n0.4,,1.5,3e-3\n"
        ),
        "duration [s],current [A],displacement [m]" + PLAIN[PLAIN.index("\n") :],
    ],
)
def test_dialects_of_text_give_the_same_record(tmp_path, text):
    check(read_record(write(tmp_path, text), SIGNALS))


def test_a_file_that_is_not_utf8_is_read_and_said_to_be(tmp_path):
    record = read_record(
        write(tmp_path, "time [s],T [°C]\n0,20\n1,21\n".encode("cp1252")), {"T": "K"}
    )
    np.testing.assert_allclose(record.signals["T"], [293.15, 294.15])
    assert [r.kind for r in record.repairs] == ["encoding"]


def test_parquet(tmp_path):
    arrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    fields = [
        arrow.field("time [ms]", arrow.float64()),
        arrow.field("current", arrow.float64(), metadata={"unit": "mA"}),
        arrow.field("displacement [m]", arrow.float64()),
        arrow.field("remark", arrow.string()),
    ]
    columns = [TIME * 1e3, CURRENT * 1e3, DISPLACEMENT, ["a", "b", "c", "d"]]
    parquet.write_table(arrow.table(columns, schema=arrow.schema(fields)), tmp_path / "r.parquet")
    record = read_record(tmp_path / "r.parquet", SIGNALS)
    check(record)
    assert [r.kind for r in record.repairs] == ["ignored columns"]


def test_parquet_null_is_missing_and_instants_become_seconds(tmp_path):
    arrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    instants = np.datetime64("2020-01-01T00:00:00") + (TIME * 1000).astype("timedelta64[ms]")
    table = arrow.table(
        {"time": instants, "displacement [m]": arrow.array([1e-3, None, 4e-3, 3e-3])}
    )
    parquet.write_table(table, tmp_path / "r.parquet")
    record = read_record(tmp_path / "r.parquet", SIGNALS)
    np.testing.assert_allclose(record.time, TIME)
    assert np.flatnonzero(np.isnan(record.signals["displacement"])).tolist() == [1]
    assert [(r.kind, r.rows) for r in record.repairs] == [("masked", (2,))]


@pytest.mark.parametrize("clock", ["channel", "waveform"])
def test_tdms(tmp_path, clock):
    nptdms = pytest.importorskip("nptdms")
    properties = {"wf_increment": 0.5, "wf_start_offset": 0.0}
    channels = [
        nptdms.ChannelObject("g", "current", CURRENT * 1e3, {"unit_string": "mA", **properties}),
        nptdms.ChannelObject("g", "displacement [m]", DISPLACEMENT, properties),
    ]
    if clock == "channel":
        channels.insert(0, nptdms.ChannelObject("g", "time [ms]", TIME * 1e3))
    with nptdms.TdmsWriter(tmp_path / "r.tdms") as writer:
        writer.write_segment(channels)
    record = read_record(tmp_path / "r.tdms", SIGNALS)
    check(record)
    assert [r.kind for r in record.repairs] == (
        ["clock from header"] if clock == "waveform" else []
    )


@pytest.mark.parametrize(("lost", "complete"), [(8, 7), (9, 6), (33, 4), (100, 4)])
def test_a_tdms_file_cut_off_keeps_its_complete_rows_and_says_so(tmp_path, lost, complete):
    nptdms = pytest.importorskip("nptdms")
    path = tmp_path / "r.tdms"
    with nptdms.TdmsWriter(path) as writer:
        for origin in (0.0, 2.0):
            channels = {"time [s]": TIME + origin, "current [A]": CURRENT}
            writer.write_segment(
                [nptdms.ChannelObject("g", name, values) for name, values in channels.items()]
            )
    path.write_bytes(path.read_bytes()[:-lost])
    record = read_record(path, SIGNALS)
    np.testing.assert_array_equal(record.time, 0.5 * np.arange(complete))
    np.testing.assert_array_equal(record.signals["current"], np.tile(CURRENT, 2)[:complete])
    assert [r.kind for r in record.repairs] == ["partial line"]


@pytest.mark.parametrize(
    "units",
    [
        {"current": "mA", "time": "s", "displacement": "m"},
        np.array(["current [mA]", "time [s]", "displacement [m]"], dtype=object),
    ],
)
def test_mat(tmp_path, units):
    from scipy.io import savemat

    content = {
        "displacement": DISPLACEMENT[:, None],
        "current": CURRENT * 1e3,
        "time": TIME,
        "units": units,
    }
    savemat(tmp_path / "r.mat", {**content, "rig": "left", "matrix": np.eye(3)})
    record = read_record(tmp_path / "r.mat", SIGNALS)
    check(record)
    assert [r.kind for r in record.repairs] == ["ignored columns"]
    assert "matrix" in record.repairs[0].message


def test_mat_without_units_is_taken_in_si_and_says_so(tmp_path):
    from scipy.io import savemat

    savemat(tmp_path / "r.mat", {"time": TIME, "current": CURRENT, "displacement": DISPLACEMENT})
    record = read_record(tmp_path / "r.mat", SIGNALS)
    check(record)
    assert [r.kind for r in record.repairs] == ["unit assumed"] * 3


LVM = """LabVIEW Measurement
Writer_Version\t2
Separator\tTab
Decimal_Separator\t.
X_Columns\tOne
***End_of_Header***

Channels\t2
Samples\t4\t4
Y_Unit_Label\tmA\tmm
X_Dimension\tTime\tTime
X0\t0.0E+0\t0.0E+0
Delta_X\t0.500000\t0.500000
***End_of_Header***
X_Value\tcurrent\tdisplacement\tComment
0\t100\t1
0.5\t-200\t2
1\t300\t4
1.5\t400\t3
"""


@pytest.mark.parametrize(
    "text",
    [
        LVM,
        LVM.replace(".", ",").replace("Decimal_Separator\t,", "Decimal_Separator\t,"),
        LVM.replace("\tComment", ""),
        LVM.replace("0\t100", "\t100")
        .replace("0.5\t-", "\t-")
        .replace("1\t300", "\t300")
        .replace("1.5\t400", "\t400"),
    ],
)
def test_labview_text(tmp_path, text):
    check(read_record(write(tmp_path, text, "r.lvm"), SIGNALS))


def test_a_second_labview_segment_is_refused_with_its_row(tmp_path):
    second = LVM[LVM.index("Channels") :]
    assert "row 26" in refusal(write(tmp_path, LVM + second, "r.lvm"))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "empty"),
        ("\n \n", "empty"),
        ("# only a comment\n", "comments"),
        ("time [s],current [A]\n", "row 1"),
        ("time [s],current [A]\n1,2\n", "one instant (row 2)"),
        ("0,1\n1,2\n", "row 1: numbers where the header should be"),
        ("# time [s],current [A]\n0,1\n1,2\n", "remove the '#'"),
        ("Dear all, the rig is down.\nSee you.\nBye\n", "row 2: 1 cells where the header has 2"),
        ("hello\nworld\n", "not a header"),
        (b"\x00\x01\x02\xff\xfe" * 40, "not a text file"),
        (bytes(np.random.default_rng(0).integers(0, 256, 4000, dtype=np.uint8)), "not a text file"),
        (b"PK\x03\x04aaaa", "spreadsheet"),
        (b"PAR1 and then nothing", "damaged"),
        (b"TDSm and then nothing of the kind at all", "TDMS file holds no complete row"),
        (
            "time [s],current [A]\n0,1\n1,abc\n2,3\n",
            "row 3, column 'current': 'abc' is not a number",
        ),
        ("time [s],current [A]\n0,1\n1,1_0\n2,3\n", "row 3, column 'current': '1_0'"),
        ("time [s],current [A]\n0,1\nnoon,2\n2,3\n", "row 3, column 'time': 'noon'"),
        ("time [s],current [A]\n0,1\n1\n2,3\n", "row 3: 1 cells where the header has 2"),
        ("time [s],current [A]\n0,1,5\n1,2\n", "row 2: 3 cells where the header has 2"),
        ('time [s],current [A]\n0,"1\n1,2\n', "row 2: the quotes"),
        ("time [s];current [A]\n0.5;1,5\n1;2\n", "decimal comma or decimal point"),
        ("time [s],current [V]\n0,1\n1,2\n", "column 'current' is in V, but current is in A"),
        ("time [s],current [blorg]\n0,1\n1,2\n", "unknown unit 'blorg'"),
        ("sample [1],current [A]\n0,1\n1,2\n", "--map 'sample=time[s]'"),
        ("current [A],displacement [m]\n0,1\n1,2\n", "no time column"),
        ("time [s],time [s],current [A]\n0,0,1\n1,1,2\n", "2 columns are called time"),
        ("time [s],current [A],current [A]\n0,0,1\n1,1,2\n", "2 columns are called 'current'"),
        ("time [s],curent [A]\n0,1\n1,2\n", "none of the columns time, curent"),
    ],
)
def test_what_is_no_record_is_refused(tmp_path, text, says):
    assert says in refusal(write(tmp_path, text))


def test_a_missing_file_a_folder_and_a_wrong_extension_are_refused(tmp_path):
    assert "cannot be read" in refusal(tmp_path / "absent.csv")
    assert "cannot be read" in refusal(tmp_path)
    assert "not a Parquet file" in refusal(write(tmp_path, PLAIN, "r.parquet"))
    assert "HDF5" in refusal(write(tmp_path, b"\x89HDF\r\n\x1a\n" + bytes(600), "r.mat"))


def test_channels_of_unequal_length_are_refused(tmp_path):
    from scipy.io import savemat

    savemat(tmp_path / "r.mat", {"time": TIME, "current": CURRENT[:3]})
    assert "'current' has 3 values, 'time' has 4" in refusal(tmp_path / "r.mat")


@pytest.mark.parametrize(("name", "module"), [("r.parquet", "pyarrow"), ("r.tdms", "nptdms")])
def test_an_absent_library_is_named_with_the_command_that_installs_it(
    tmp_path, monkeypatch, name, module
):
    original = builtins.__import__

    def without(target, *arguments, **options):
        if target.split(".")[0] == module:
            raise ImportError(target)
        return original(target, *arguments, **options)

    path = write(tmp_path, b"PAR1" if module == "pyarrow" else b"TDSm", name)
    monkeypatch.setattr(builtins, "__import__", without)
    (tmp_path / f"{module}.py").write_text("raise ImportError")  # for a process that reads
    monkeypatch.setenv(
        "PYTHONPATH", os.pathsep.join([str(tmp_path), str(Path(__file__).parents[4])])
    )
    assert "pip install 'ppy-rig[records]'" in refusal(path)


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
    assert "--map" in message


def test_a_frequency_is_not_taken_for_an_angular_speed(tmp_path):
    path = write(tmp_path, "time [s],speed [Hz]\n0,1\n1,2\n")
    assert "cannot be converted" in refusal(path, {"speed": "rad/s"})
    path = write(tmp_path, "time [s],speed [rpm]\n0,60\n1,30\n")
    np.testing.assert_allclose(
        read_record(path, {"speed": "rad/s"}).signals["speed"], [2 * np.pi, np.pi]
    )
