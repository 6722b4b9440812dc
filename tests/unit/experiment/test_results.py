"""Claims: results carry units and their experiment, read back bit by bit in every form, and are
made again from it.
"""

import json
import re
import warnings

import numpy as np
import pandas
import pytest
import xarray

from fmus import component
from fmus.kit import UserError
from orchestration import master
from orchestration.experiment import results
from orchestration.experiment.execution import run
from orchestration.experiment.reading import read
from orchestration.records import read_record
from orchestration.system import Member, Port, System, ssp
from tests.support.command import here, on_terminal, posix, refused, works
from tests.support.experiments import PLAYED, played_record
from tests.support.pace import slow_but


@pytest.fixture
def folder(tmp_path):
    return played_record(tmp_path)


def same(one, other):
    """Return True if the values of two datasets are the same to the bit."""
    return set(one.variables) == set(other.variables) and all(
        one[n].values.astype("<f8").tobytes() == other[n].values.astype("<f8").tobytes()
        for n in one.variables
    )


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["nc", "parquet"])
def test_a_result_is_made_again_to_the_last_bit_without_the_file_it_came_from(folder, ending):
    first = f"first.{ending}"
    works("run", "play.toml", "--out", first, cwd=folder)
    (folder / "drive.csv").unlink()
    (folder / "play.toml").unlink()
    elsewhere = folder / "elsewhere"
    elsewhere.mkdir()
    printed = works("run", f"../{first}", "--out", "again.nc", cwd=elsewhere)
    assert f"every value is the same to the last bit as in ../{first}" in printed
    one, again = results.read(folder / first), results.read(elsewhere / "again.nc")
    assert same(one, again)
    assert one.time.size == 31
    assert one.current.values[-1] == np.sin(3.0)
    third = works("run", "again.nc", cwd=elsewhere)  # and again from what was made again
    assert "every value is the same to the last bit as in again.nc" in third


def test_the_metadata_tell_what_was_run(folder):
    done = run(read(str(folder / "play.toml")))
    results.write(done, folder / "run.nc")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        opened = xarray.load_dataset(folder / "run.nc")  # as anybody would
    assert same(opened, done)
    assert opened.voltage.attrs["units"] == "V"
    assert opened.displacement.attrs["units"] == "m"
    assert opened.displacement.attrs["display_units"] == "mm"
    assert opened.voltage.attrs["long_name"].startswith("Voltage across the actuator")
    assert opened.time.attrs["units"] == "s"
    assert (opened.attrs["complete"], opened.attrs["seed"], opened.attrs["step"]) == (1, 3, 0.1)
    assert json.loads(opened.attrs["parameters"]) == {"R1": "0.61 ohm"}
    assert re.fullmatch(r"\{[0-9a-f-]{36}\}", json.loads(opened.attrs["guids"])["ppy_actuator"])
    assert 0.0 < opened.attrs["wall_time"] < 60.0
    assert opened.attrs["versions"].startswith("ppy-rig ")
    resolved = json.loads(opened.attrs["experiment"])
    assert resolved["inputs"]["force"]["kind"] == "multilevel"
    assert resolved["runtime"] == "native"


def test_csv_and_parquet_are_records_with_every_digit(folder):
    done = run(read(str(folder / "play.toml")))
    units = {"current": "A", "force": "N", "voltage": "V", "displacement": "m"}
    for name in ("run.csv", "run.parquet", "run.nc"):
        results.write(done, folder / name)
        record = read_record(folder / name, units)
        assert record.time.tobytes() == done.time.values.tobytes()
        for signal_name, values in record.signals.items():
            assert values.tobytes() == done[signal_name].values.tobytes()
    table = pandas.read_parquet(folder / "run.parquet")
    assert list(table) == [
        "time [s]",
        "force [N]",
        "current [A]",
        "voltage [V]",
        "displacement [m]",
    ]


@pytest.mark.parametrize("ending", ["csv", "nc"])
def test_compare_reads_a_result(folder, ending):
    """The noise of 1 mV is all that is left, and the fit finds the R1 that was set.

    The displacement has no noise, so that it determines R1 to rounding: the interval is as narrow
    as that.
    """
    works("run", "play.toml", "--out", f"run.{ending}", cwd=folder)
    works("compare", f"run.{ending}", "--fit", "R1", "--out", "figures.json", cwd=folder)
    figures = json.loads((folder / "figures.json").read_text(encoding="utf-8"))
    low, high = figures["fitted"]["parameters"]["R1"]["ci95"]
    rounding = 1e-12
    assert 0.6 < low <= 0.61 + rounding
    assert 0.61 - rounding <= high < 0.62
    assert figures["fitted"]["outputs"]["voltage"]["rms"] == pytest.approx(1e-3, rel=0.5)


def edited(path, target, edit, upto=None):
    """Copy a result, or its beginning, with something changed in it."""
    data = results.read(path).isel(time=slice(upto))
    edit(data)
    results.write(data, target)
    return target


def test_a_system_is_made_again_too(tmp_path):
    settings = ["--set", "duration=20 s", "--set", "noise.actuator.voltage.rms=1mV"]
    works("run", "fig_4_5", *settings, "--out", "life.nc", cwd=tmp_path)
    assert "every value is the same to the last bit" in works("run", "life.nc", cwd=tmp_path)
    about = results.read(tmp_path / "life.nc").attrs
    assert set(json.loads(about["guids"])) == {"galvanostat", "actuator", "estimator"}
    assert json.loads(about["parameters"])["estimator.initial_voltage_limit"] == "15.0 V"
    assert json.loads(about["experiment"])["master"]["method"] == "gauss-seidel"


RATE = re.compile(r"running .*━.* [\d,]{3,}/s.*\d:\d\d:\d\d")


@pytest.mark.slow
@posix
@pytest.mark.parametrize(
    ("name", "changes"),
    slow_but([("fig_3_4", []), ("fig_3_4", ["runtime=python"]), ("fig_4_5", [])], ("fig_3_4", [])),
    ids=["component", "python build", "system"],
)
def test_an_interrupt_leaves_what_was_computed(tmp_path, name, changes):
    """A real SIGINT: exit 130, a file that says it is incomplete, whose values are those of the
    whole run.
    """
    (tmp_path / "scratch").mkdir()
    (tmp_path / "part.nc").write_text("the result of earlier work\n", encoding="utf-8")
    settings = [part for change in changes for part in ("--set", change)]
    code, printed, told = on_terminal(
        "run",
        name,
        *settings,
        "--set",
        "duration=2e5",
        "--out",
        "part.nc",
        cwd=tmp_path,
        interrupt_at=RATE,
    )
    assert code == 130, told
    assert told.splitlines()[-1] == "interrupted"
    assert "Traceback" not in told
    assert "wrote part.nc (incomplete)" in printed
    assert list((tmp_path / "scratch").glob("ppy-*")) == []
    part = results.read(tmp_path / "part.nc")
    assert part.attrs["complete"] == 0
    assert 1 < part.time.size < 2_000_001
    common = min(part.time.size, 1000)  # a busy machine has fewer by the time it is interrupted
    whole = run(read(name, [*changes, "duration=99.9"]))
    for variable in part.variables:
        first = part[variable].values[:common]
        assert first.tobytes() == whole[variable].values[:common].tobytes()


def part_of(path, points, target):
    """Make an experiment, interrupted when so many points are done."""

    def interrupt(done, whole):
        if done >= points - 1:
            raise KeyboardInterrupt

    part = run(read(str(path)), progress=interrupt)
    assert (part.attrs["complete"], part.time.size) == (0, points)
    results.write(part, target)


def test_an_incomplete_result_is_repeated_as_far_as_it_goes(folder):
    """The current comes from a file that is gone; levels, chirp and noise are those of the whole
    experiment.
    """
    chirp = (
        'force = { kind = "chirp", amplitude = 1, offset = 1, start_frequency = 0.1, stop_frequency'
        " = 2 }"
    )
    levels = re.search("force = .*", PLAYED)[0]
    for k, force in enumerate((levels, chirp)):
        (folder / "play.toml").write_text(PLAYED.replace(levels, force), encoding="utf-8")
        part_of(folder / "play.toml", 12, folder / f"part{k}.nc")
    (folder / "drive.csv").unlink()
    for name in ("part0.nc", "part1.nc"):
        done = here("run", name, "--out", "again.nc", cwd=folder)
        assert done.returncode == 0, done.stderr
        assert f"{name} is incomplete; it is repeated as far as it goes, 1.1 s" in " ".join(
            done.stderr.split()
        )
        assert f"every value is the same to the last bit as in {name}" in done.stdout
        assert "12 points, 1.1 s" in done.stdout
        assert "every value is the same" in works("run", "again.nc", cwd=folder)
    assert (
        read(str(folder / "part0.nc"), ["seed=4"]).duration == 3.0
    )  # another experiment: the whole of it
    edited(folder / "part0.nc", folder / "first.nc", lambda data: None, upto=1)
    refused(folder, "run", "first.nc", parts=["first.nc", "first point only"])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"experiment": "{broken"}, "experiment = '{broken': invalid JSON"),
        ({"experiment": "[]"}, "experiment"),
        ({"experiment": '{"inputs": 3}'}, "inputs"),
        ({"guids": "[]"}, "guids = []"),
        ({"complete": "perhaps"}, "complete = 'perhaps'"),
        ({"versions": None}, "versions is missing"),
        ({"time": None}, "it has no times"),
    ],
)
def test_damaged_metadata_are_refused_in_a_line(folder, change, said):
    works("run", "play.toml", "--out", "good.nc", cwd=folder)
    good, path = (
        xarray.load_dataset(folder / "good.nc", engine="scipy", decode_times=False),
        folder / "damaged.nc",
    )
    about = {n: v for n, v in {**good.attrs, **change}.items() if v is not None and n != "time"}
    damaged = good.drop_attrs(deep=False).assign_attrs(about)
    (damaged.drop_vars("time") if "time" in change else damaged).to_netcdf(path, engine="scipy")
    with pytest.raises(UserError) as caught:
        results.read(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_names_that_a_format_cannot_hold_are_refused_before_the_run(folder, monkeypatch):
    """A system with such a member; in a format that can hold it, it comes back."""
    name, target = "∆", "new.nc"
    member = Member.of(name, component("ppy_actuator"), {"force": 0.0})
    ssp.write(
        System("odd", (member,), (), {"current": (Port(name, "current"),)}), folder / "odd.ssp"
    )
    (folder / "odd.toml").write_text(
        "system = 'odd.ssp'\nduration = 1\nstep = 0.1\nrecord ="
        f" ['{name}.charge']\n[inputs]\ncurrent = 1",
        "utf-8",
    )
    assert here("run", "odd.toml", "--out", "can.parquet", cwd=folder).returncode == 0
    assert "the same to the last bit" in here("run", "can.parquet", cwd=folder).stdout
    monkeypatch.setattr(master, "run", lambda *given, **options: pytest.fail("it ran"))
    parts = [target, f"'{name}.charge'", "NetCDF"]
    refused(folder, "run", "odd.toml", "--out", target, parts=parts)
