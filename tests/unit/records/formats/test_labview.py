"""Claims: LabVIEW's text and TDMS files give the same record; what is cut off is said."""

import numpy as np
import pytest

from orchestration.records import read_record
from tests.support.record_forms import CURRENT, DISPLACEMENT, SIGNALS, TIME, check, refusal, write


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


@pytest.mark.parametrize("late", ["start", "offset"])
@pytest.mark.parametrize("step", [0.1, 0.2, 0.25])
def test_channels_that_begin_later_or_are_slower_keep_their_instants(tmp_path, late, step):
    nptdms = pytest.importorskip("nptdms")
    began = np.datetime64("2026-01-01T00:00:00", "us")
    shift = np.timedelta64(3, "s") if late == "start" else np.timedelta64(0, "s")
    first = {"wf_increment": 0.1, "wf_start_time": began, "wf_start_offset": 0.0}
    other = {
        "wf_increment": step,
        "wf_start_time": began + shift,
        "wf_start_offset": 3.0 if late == "offset" else 0.0,
    }
    fast, slow = 0.1 * np.arange(100), 3.0 + step * np.arange(40)
    with nptdms.TdmsWriter(tmp_path / "r.tdms") as writer:
        writer.write_segment(
            [
                nptdms.ChannelObject("g", "current [A]", np.sin(fast), first),
                nptdms.ChannelObject("g", "displacement [m]", np.cos(slow), other),
            ]
        )
    record = read_record(tmp_path / "r.tdms", SIGNALS)
    for name, instants, values in (("current", fast, np.sin), ("displacement", slow, np.cos)):
        measured = np.isfinite(record.signals[name])
        np.testing.assert_allclose(record.time[measured], instants, atol=1e-9)
        np.testing.assert_allclose(record.signals[name][measured], values(instants), rtol=1e-12)


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
WITHOUT_X = (
    LVM.replace("0\t100", "\t100")
    .replace("0.5\t-", "\t-")
    .replace("1\t300", "\t300")
    .replace("1.5\t400", "\t400")
)


@pytest.mark.parametrize(
    "text",
    [
        LVM,
        LVM.replace(".", ",").replace("Decimal_Separator\t,", "Decimal_Separator\t,"),
        LVM.replace("\tComment", ""),
        WITHOUT_X,
    ],
)
def test_labview_text(tmp_path, text):
    check(read_record(write(tmp_path, text, "r.lvm"), SIGNALS))


def test_a_time_from_the_header_keeps_the_name_of_its_column(tmp_path):
    path = write(tmp_path, WITHOUT_X, "r.lvm")
    check(read_record(path, SIGNALS, mapping={"X_Value": "time"}))


def test_a_second_labview_segment_is_refused_with_its_row(tmp_path):
    second = LVM[LVM.index("Channels") :]
    assert "row 26" in refusal(write(tmp_path, LVM + second, "r.lvm"))
