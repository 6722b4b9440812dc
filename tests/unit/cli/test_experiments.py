"""Claims: a system is simulated and run from its file; an input that nothing feeds stays at the
start value of its FMU, and that is said.

Oracle: two gains in a row, 3 and 2, whose product is known.
"""

from __future__ import annotations

import json

import pytest

from fmus import component
from fmus.kit.build import build_cached
from orchestration.experiment import results
from orchestration.fmu import read_description
from orchestration.records import read_record
from orchestration.system import Member, Port, System, connect, ssp
from tests.support.amplifier import Amplifier
from tests.support.command import here, refused, works

UNITS = {"drive": "V", "second.y": "V"}


def row_of_two(path, inputs, connections=("first.y -> second.u",)):
    """Write a row of two gains."""
    members = tuple(
        Member.of(name, Amplifier, {"factor": factor}, "python")
        for name, factor in (("first", 3.0), ("second", 2.0))
    )
    outputs = {"y": Port("second", "y")}
    system = System("row", members, connect(*connections), inputs, outputs, step=0.1, stop=1.0)
    ssp.write(system, path, connectors=True)


@pytest.fixture
def row(tmp_path):
    row_of_two(tmp_path / "row.ssp", {"drive": (Port("first", "u"),)})
    return tmp_path


def last(folder, name="out.csv"):
    record = read_record(folder / name, UNITS)
    return record.time[-1], record.signals["second.y"][-1]


def test_inputs_and_parameters_are_set_by_their_names(row):
    arguments = ("--set", "drive=500mV", "--set", "first.factor=5", "--stop", "400ms")
    works("simulate", "row.ssp", *arguments, "--out", "out.csv", cwd=row)
    assert last(row) == pytest.approx((0.4, 0.5 * 5.0 * 2.0))


def test_a_record_drives_a_system(row):
    (row / "in.csv").write_text("t [s],U [mV]\n0,0\n0.2,500\n0.6,250\n", encoding="utf-8")
    arguments = ("--input", "in.csv", "--map", "U=drive")
    works("simulate", "row.ssp", *arguments, "--out", "out.csv", cwd=row)
    assert last(row) == pytest.approx((0.6, 0.25 * 3.0 * 2.0))
    record = read_record(row / "out.csv", UNITS)
    assert record.signals["drive"] == pytest.approx([0.0, 0.0, 0.5, 0.5, 0.5, 0.5, 0.25])


@pytest.mark.slow
def test_a_system_is_run_and_made_again(row):
    works("run", "row.ssp", "--set", "inputs.drive=1V", "--out", "out.nc", cwd=row)
    assert "the same to the last bit" in works("run", "out.nc", cwd=row)


@pytest.mark.parametrize(
    "command",
    [
        ["run"],
        ["simulate"],
        ["sweep", "--over", "first.factor=1,2"],
        ["system", "export", "--out", "again.ssp"],
    ],
    ids=lambda command: command[0],
)
def test_a_file_of_a_system_has_no_other_build_to_choose(row, command):
    told = "--runtime native: row.ssp is taken as it is; only components are built"
    refused(row, *command, "row.ssp", "--runtime", "native", parts=[told])


def test_a_system_that_ships_is_simulated_in_the_build_that_is_chosen(tmp_path):
    arguments = ("simulate", "dma_bench", "--set", "force_reference=1N", "--stop", "20ms")
    works(*arguments, "--runtime", "python", "--out", "run.nc", cwd=tmp_path)
    guids = json.loads(results.read(tmp_path / "run.nc").attrs["guids"])
    assert (
        guids["bench"] == read_description(build_cached(component("voice_coil_dma"), "python")).guid
    )


@pytest.mark.slow
@pytest.mark.parametrize("command", ["run", "simulate"])
def test_the_start_value_of_an_input_that_nothing_feeds_is_used(tmp_path, command):
    row_of_two(tmp_path / "row.ssp", {"drive": (Port("first", "u"),)}, connections=())
    done = here(command, "row.ssp", "--out", "out.csv", cwd=tmp_path)
    assert (done.returncode, last(tmp_path)) == (0, (1.0, 1.5 * 2.0))
    told = " ".join(done.stderr.split())
    assert "nothing feeds second.u; it stays at 1.5 V, the start value of its FMU" in told
    done = here(command, "row.ssp", "--set", "second.u=4", "--out", "out.csv", cwd=tmp_path)
    assert last(tmp_path)[1] == 4.0 * 2.0
    assert "second.u" not in done.stderr


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["--with", "sensor_lag(y)"], "--with is about one model; row.ssp is a system"),
        (["--preset", "soft"], "--preset is about one model"),
        (["--set", "drift=1"], "row has no parameter named 'drift'"),
        (["--set", "drive=1A"], "inputs.drive"),
        (["--out", "row.ssp"], "the model itself"),
    ],
)
def test_what_cannot_be_simulated_is_refused(row, arguments, part):
    refused(row, "simulate", "row.ssp", *arguments, parts=[part])
