"""Journal of a sweep: it removes only its own files, and one process at a time works on it.

What it has survives an interrupt, a full disk and a process that is killed.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import time
from importlib.util import find_spec

import numpy as np
import pytest
import xarray

import orchestration as ppy
from fmus.kit import UserError
from fmus.kit.storage import scratch
from orchestration.fmu.simulation import RepeatedFmu
from orchestration.journal import removed_after
from orchestration.sweeps.storage import zarr_store as stored
from tests.support.command import refused, works
from tests.support.hosts import MINIMAL_PYTHONFMU_SOURCE, build_one_state_fmu, build_pythonfmu
from tests.support.small_disk import disk_of_64_kib
from tests.support.source import ROOT

TIME = 0.1 * np.arange(51)


CALL = (
    "sweep",
    "one_state.fmu",
    "--set",
    "u=2",
    "--stop",
    "5s",
    "--step",
    "0.1s",
    "--over",
    "tau=0.5..2:3",
)


needs_zarr = pytest.mark.skipif(find_spec("zarr") is None, reason="no Zarr without zarr")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return build_one_state_fmu(tmp_path_factory.mktemp("made"))


@pytest.fixture
def folder(made, tmp_path):
    (tmp_path / made.name).write_bytes(made.read_bytes())
    return tmp_path


def interrupted(folder, **more):
    """Interrupt a sweep after a few of 20 cases, and return a function that goes on with it."""

    def interrupt(done, whole):
        if done >= 3:
            raise KeyboardInterrupt

    call = {
        "over": {"tau": "0.5..4:20"},
        "inputs": {"u": 1.0},
        "time": TIME,
        "folder": folder / "part",
    } | more
    with pytest.raises(KeyboardInterrupt):
        ppy.sweep(str(folder / "one_state.fmu"), **call, progress=interrupt)
    return lambda: ppy.sweep(str(folder / "one_state.fmu"), **call)


@needs_zarr
@pytest.mark.parametrize("out", ["a.nc", "a.zarr"])
@pytest.mark.parametrize("mine", ["mine.txt", "numbers.npy/mine.txt", "data/mine.txt"])
def test_a_folder_of_somebody_else_is_no_journal(folder, out, mine):
    path = folder / f"{out}.part" / mine
    path.parent.mkdir(parents=True)
    path.write_text("dear")
    refused(
        folder,
        *CALL,
        "--out",
        out,
        parts=[f"{out}.part: holds {mine.split('/')[0]}", "no part of a journal"],
    )
    assert path.read_text() == "dear"
    assert [*path.parent.iterdir()] == [path]


@needs_zarr
def test_a_folder_beside_a_store_stays(folder):
    """Its name is that of the store with an ending."""
    for ending in ("new", "old", "tmp"):
        (folder / f"a.zarr.{ending}").mkdir()
        (folder / f"a.zarr.{ending}" / "mine.txt").write_text("dear")
    for _ in range(2):
        works(*CALL, "--out", "a.zarr", cwd=folder)
    for ending in ("new", "old", "tmp"):
        assert (folder / f"a.zarr.{ending}" / "mine.txt").read_text() == "dear"
    assert sorted(path.name for path in folder.iterdir()) == [
        "a.zarr",
        "a.zarr.new",
        "a.zarr.old",
        "a.zarr.tmp",
        "one_state.fmu",
    ]


def test_what_comes_into_the_folder_meanwhile_stays(folder):
    goes_on = interrupted(folder)
    (folder / "part" / "failures.jsonl.0123.part").write_text("left by a process that was killed")
    assert goes_on()["x_last"].shape == (20,)
    with removed_after(folder / "part"):
        (folder / "part" / "mine.txt").write_text("dear")
    assert [path.name for path in (folder / "part").iterdir()] == ["mine.txt"]


@needs_zarr
@pytest.mark.parametrize("place", ["mine.txt", "x_last/mine.txt", "data/mine.txt"])
def test_a_store_with_anything_else_in_it_is_not_replaced(folder, place):
    works(*CALL, "--out", "a.zarr", cwd=folder)
    (folder / "a.zarr" / place).parent.mkdir(exist_ok=True)
    (folder / "a.zarr" / place).write_text("dear")
    first = place.removesuffix("/mine.txt") if place.startswith("data") else place
    refused(
        folder, *CALL, "--out", "a.zarr", parts=[f"a.zarr: holds {first}, which is not of a store"]
    )
    assert not (folder / "a.zarr.part").exists(), "it is told before any work"
    assert (folder / "a.zarr" / place).read_text() == "dear"


@needs_zarr
@pytest.mark.parametrize("form", [2, 3])
def test_a_store_of_somebody_else_is_not_replaced(folder, form):
    theirs = xarray.Dataset({"x": ("a", np.arange(3.0))}, attrs={"over": "a"})
    theirs.to_zarr(folder / "a.zarr", zarr_format=form, consolidated=False)
    refused(folder, *CALL, "--out", "a.zarr", parts=["a.zarr: is ", "it will not be overwritten"])
    assert xarray.open_zarr(folder / "a.zarr", consolidated=False).load().identical(theirs)


@needs_zarr
@pytest.mark.parametrize("there", [True, False])
def test_a_link_is_refused_before_any_work(folder, there):
    if there:
        works(*CALL, "--out", "real.zarr", cwd=folder)
    (folder / "a.zarr").symlink_to(folder / "real.zarr")
    refused(folder, *CALL, "--out", "a.zarr", parts=["a.zarr: is a link"])
    assert not (folder / "a.zarr.part").exists()


@needs_zarr
def test_a_store_that_changed_meanwhile_is_not_replaced(folder):
    works(*CALL, "--out", "a.zarr", cwd=folder)
    data = ppy.sweep(str(folder / "one_state.fmu"), {"tau": [1.0, 2.0]}, time=TIME)
    (folder / "a.zarr" / "mine.txt").write_text("dear")
    with pytest.raises(UserError, match=r"holds mine\.txt"):
        stored.write(data, folder / "a.zarr")


def gone(path):
    path.unlink()


def of_shape(*shape, kind="f8"):
    return lambda path: np.save(path, np.zeros(shape, kind))


def holding(text):
    return lambda path: path.write_text(text)


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        ("work.json", holding("[1]")),
        ("work.json", holding("[" * 100_000)),
        ("numbers.npy", of_shape(20, 3)),
        ("numbers.npy", of_shape(20, 3, 1, kind="f4")),
        ("numbers.npy", gone),
        ("numbers.npy", holding("")),
        ("done.npy", of_shape(19, kind="u1")),
        ("done.npy", gone),
        ("traces.npy", of_shape(20, 51)),
        ("traces.npy", gone),
        ("traces.npy", holding("")),
        ("failures.jsonl", holding("5\n")),
        ("failures.jsonl", holding('[null, "x"]\n')),
        ("failures.jsonl", holding('[20, "x"]\n')),
    ],
)
def test_what_is_damaged_is_told_in_a_line(folder, name, damage):
    goes_on = interrupted(folder, keep=["last", "mean", "rms", "trace"])
    damage(folder / "part" / name)
    with pytest.raises(
        UserError, match=r"part: is damaged \(.*\); remove it to begin anew"
    ) as told:
        goes_on()
    assert "\n" not in str(told.value)


def test_a_case_that_failed_and_was_not_done_has_no_failure_afterwards(folder):
    """The process may end between the two; the case is run again, and it may succeed then."""
    goes_on = interrupted(folder)
    with (folder / "part" / "failures.jsonl").open("a") as file:
        file.write(json.dumps([15, "no memory"]) + "\n")
    whole = goes_on()
    assert "failure" not in whole
    assert np.isfinite(whole["x_last"].values).all()
    assert "failure" not in goes_on(), "nor when it is read again"


HOLDS = """
import sys, time, pathlib
from orchestration.journal import locked_folder
with locked_folder(pathlib.Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


def test_two_processes_do_not_work_on_one_sweep(folder):
    part = folder / "a.nc.part"
    with subprocess.Popen([sys.executable, "-c", HOLDS, part], stdout=subprocess.PIPE) as other:
        try:
            assert other.stdout.readline() == b"held\n"
            told = refused(
                folder, *CALL, "--out", "a.nc", parts=["a.nc.part: another process works on it"]
            )
            assert str(other.pid) in told
        finally:
            other.kill()
    works(*CALL, "--out", "a.nc", cwd=folder)  # one that was killed is in nobody's way
    assert not part.exists()


def test_nor_do_two_sweeps_of_one_process(folder):
    part = folder / "part"

    def twice(done, whole):
        with pytest.raises(UserError, match="another process works on it"):
            ppy.sweep(str(folder / "one_state.fmu"), {"tau": [1.0, 2.0]}, time=TIME, folder=part)

    ppy.sweep(
        str(folder / "one_state.fmu"), {"tau": [1.0, 2.0]}, time=TIME, folder=part, progress=twice
    )
    assert not (part / "lock").exists()


def test_a_lock_of_a_process_that_had_our_number_is_stale(folder):
    """As in a container, where the same command has the same number again."""
    (folder / "part").mkdir()
    (folder / "part" / "lock").write_text(f"{os.getpid()}\n")
    found = ppy.sweep(
        str(folder / "one_state.fmu"), {"tau": [1.0, 2.0]}, time=TIME, folder=folder / "part"
    )
    assert found["x_last"].shape == (2,)


def test_where_a_folder_is_given_none_is_made_elsewhere(folder, monkeypatch):
    asked, known = [], scratch.make
    monkeypatch.setattr(scratch, "make", lambda kind: (asked.append(kind), known(kind))[1])
    call = {"over": {"tau": [1.0, 2.0]}, "time": TIME}
    ppy.sweep(str(folder / "one_state.fmu"), **call, folder=folder / "part")
    assert "sweep" not in asked
    ppy.sweep(str(folder / "one_state.fmu"), **call)
    assert "sweep" in asked


@pytest.fixture
def small_disk(tmp_path):
    with disk_of_64_kib(tmp_path / "disk") as folder:
        yield folder


def test_a_small_disk_goes_with_the_process_that_has_it(tmp_path):
    """Killed, it unmounts nothing itself."""
    program = (
        "import sys, time, pathlib; from tests.support.small_disk import disk_of_64_kib\n"
        "with disk_of_64_kib(pathlib.Path(sys.argv[1])): print('there', flush=True); time.sleep(60)"
    )
    folder = tmp_path / "disk"
    with subprocess.Popen(
        [sys.executable, "-c", program, folder], cwd=ROOT, stdout=subprocess.PIPE
    ) as running:
        if running.stdout.readline() != b"there\n":
            pytest.skip("this user may not mount a file system")
        assert os.path.ismount(folder)
        running.kill()
    until = time.monotonic() + 10.0
    while os.path.ismount(folder) and time.monotonic() < until:
        time.sleep(0.05)
    assert not os.path.ismount(folder)


def ran(monkeypatch):
    """Count runs of the FMU."""
    counted, known = [], RepeatedFmu.run
    monkeypatch.setattr(RepeatedFmu, "run", lambda *given: counted.append(1) or known(*given))
    return counted


def test_a_sweep_that_has_no_room_is_refused_before_anything_runs(lag, small_disk, monkeypatch):
    """Its arrays are mapped: what does not fit would end the process as it is written."""
    counted = ran(monkeypatch)
    call = {"inputs": {"u": 1.0}, "time": TIME, "keep": ["trace"]}
    with pytest.raises(
        UserError, match=r"part: cannot be written \(No space left on device\)"
    ) as refused:
        ppy.sweep(lag, {"tau": "0.5..4:400"}, **call, folder=small_disk / "part")
    assert "\n" not in str(refused.value)
    assert counted == []
    found = ppy.sweep(lag, {"tau": "0.5..4:20"}, **call, folder=small_disk / "part")
    assert found["x"].shape == (20, 51)


def test_a_disk_that_fills_while_cases_fail_loses_nothing(tmp_path, small_disk):
    """Only reasons of failures grow; what was done before remains."""
    step = "    def do_step(self, current_time, step_size):\n"
    refuses = "        if self.u >= 5.0:\n            return False\n"
    source = MINIMAL_PYTHONFMU_SOURCE.replace(step, step + refuses).replace("Minimal", "Refusing")
    fragile = str(build_pythonfmu(tmp_path, "refusing", source))

    def fill(done, whole):
        if done >= 5:
            with (
                (small_disk / "other").open("wb", buffering=0) as file,
                contextlib.suppress(OSError),
            ):
                while True:
                    file.write(bytes(512))

    # Python FMUs of one name share a module in a process, so that this one has a name of its own
    call = {"over": {"u": "1..60:60"}, "time": TIME[:3], "keep": ["last"]}
    with pytest.raises(UserError, match=r"No space left on device\); what is done stands there"):
        ppy.sweep(fragile, **call, folder=small_disk / "part", progress=fill)
    (small_disk / "other").unlink()
    seen = []
    again = ppy.sweep(
        fragile, **call, folder=small_disk / "part", progress=lambda done, whole: seen.append(done)
    )
    assert seen[0] > 5
    assert again.identical(ppy.sweep(fragile, **call))
