"""Zarr stores of sweeps, which are written in parts.

Oracles: the same sweep in memory, bit by bit; the memory that the process had.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
import xarray

import orchestration as ppy
from fmus.kit import UserError
from orchestration.sweeps.storage import zarr_store as stored
from tests.support.command import here, on_terminal, posix, refused, works
from tests.support.hosts import MINIMAL_PYTHONFMU_SOURCE, build_one_state_fmu, build_pythonfmu

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
    "--keep",
    "last,trace",
)


MEASURED = """
import re, resource, sys
from orchestration.cli import app
sys.argv = ["ppy", *sys.argv[1:]]
try:
    app.main()
except SystemExit as ended:
    assert ended.code == 0
try:  # in ru_maxrss there is also what the process had that started this one
    with open("/proc/self/status") as status:
        print(re.search(r"VmHWM:\\s+(\\d+) kB", status.read())[1])
except OSError:
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stored")
    build_one_state_fmu(folder)
    return folder


def opened(path):
    return xarray.open_dataset(path, engine="zarr", chunks={})


@pytest.mark.slow
def test_a_store_has_what_the_file_has(folder):
    call = (*CALL, "--over", "tau=0.5..2:40", "--over", "u=1,2,3")
    call = tuple(word for word in call if word not in ("--set", "u=2"))
    works(*call, "--out", "a.zarr", cwd=folder)
    works(*call, "--out", "a.nc", cwd=folder)
    store, file = opened(folder / "a.zarr"), xarray.load_dataset(folder / "a.nc", engine="scipy")
    assert store.x.chunks is not None
    assert store.load().identical(file)
    assert store.x.values.tobytes() == file.x.values.tobytes()
    assert (store.x.units, store.tau.units, store.x.dims) == ("1", "s", ("tau", "u", "time"))
    exact = store.u.values[:, None] * (1.0 - np.exp(-TIME / store.tau.values[:, None, None]))
    assert store.x.values == pytest.approx(exact, abs=1e-12)
    assert not (folder / "a.zarr.part").exists()
    assert not (folder / "a.zarr.new").exists()


def test_a_store_is_replaced_and_nothing_else_is(folder):
    for count in (3, 4):
        works(*CALL, "--over", f"tau=0.5..2:{count}", "--out", "b.zarr", cwd=folder)
        assert opened(folder / "b.zarr").sizes["tau"] == count
    (folder / "mine.zarr").mkdir(exist_ok=True)
    (folder / "mine.zarr" / "letter.txt").write_text("dear")
    (folder / "file.zarr").write_text("dear")
    for name in ("mine.zarr", "file.zarr"):
        refused(folder, *CALL, "--over", "tau=0.5..2:3", "--out", name, parts=[name])
    refused(folder, *CALL, "--over", "tau=0.5..2:3", "--out", "c.zip", parts=[".nc or .zarr"])


@pytest.mark.slow
def test_failures_are_in_a_store(tmp_path):
    step = "    def do_step(self, current_time, step_size):\n"
    source = MINIMAL_PYTHONFMU_SOURCE.replace(
        step, step + "        if self.u >= 5.0:\n            return False\n"
    )
    fragile = build_pythonfmu(tmp_path, "refusing_few", source.replace("Minimal", "RefusingFew"))
    call = (
        "sweep",
        fragile,
        "--over",
        "u=1,6,2",
        "--stop",
        "1s",
        "--step",
        "0.1s",
        "--keep",
        "last,trace",
    )
    works(*call, "--out", "f.zarr", cwd=tmp_path)
    works(*call, "--out", "f.nc", cwd=tmp_path)
    store = opened(tmp_path / "f.zarr").load()
    assert [bool(reason) for reason in store.failure.values] == [False, True, False]
    assert np.isnan(store.x.values).all(axis=1).tolist() == [False, True, False]
    assert store.identical(xarray.load_dataset(tmp_path / "f.nc", engine="scipy"))


@pytest.mark.slow
@posix
def test_interrupted_it_goes_on_into_the_store(folder):
    call = [*CALL, "--over", "tau=0.5..2:1500", "--step", "0.001s", "--out", "d.zarr"]
    (folder / "scratch").mkdir(exist_ok=True)
    code, _, _ = on_terminal(*call, cwd=folder, interrupt_at=re.compile(r"\d of 1,500"))
    assert code == 130
    assert (folder / "d.zarr.part").is_dir()
    assert not (folder / "d.zarr").exists()
    begun = int(np.load(folder / "d.zarr.part" / "done.npy").sum())
    works(*call, cwd=folder)
    assert begun < 1500
    store = opened(folder / "d.zarr")
    for case in (0, begun - 1, begun, 1499):
        exact = 2.0 * (1.0 - np.exp(-store.time.values / float(store.tau[case])))
        assert np.abs(store.x.isel(tau=case).values - exact).max() < 1e-12
    assert np.isfinite(store.x.values).all()
    shutil.rmtree(folder / "d.zarr")


def test_what_a_sweep_comes_to_is_in_the_store(folder):
    call = (*CALL, "--over", "tau=0.5..2", "--design", "tornado", "--out", "t.zarr")
    works(*call, cwd=folder)
    store = opened(folder / "t.zarr").load()
    exact = 2.0 * (1.0 - np.exp(-5.0 / np.array([0.5, 2.0])))
    assert store["x_last_tornado"].sel(parameter="tau").values == pytest.approx(exact)


def peak(*arguments, cwd):
    """Return the largest resident memory of the command, MB."""
    done = subprocess.run(
        [sys.executable, "-c", MEASURED, *arguments], cwd=cwd, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return int(done.stdout.splitlines()[-1]) / (1e6 if sys.platform == "darwin" else 1e3)


@pytest.mark.slow
@posix
def test_traces_need_not_fit_into_memory(folder):
    """200 MB of traces take only a few chunks of 8 MB more than a small sweep takes."""
    call = [*CALL[:4], "--stop", "10s", "--step", "0.0001s", "--keep", "trace"]
    small = peak(*call, "--over", "tau=0.5..2:5", "--out", "s.zarr", cwd=folder)
    large = peak(*call, "--over", "tau=0.5..2:250", "--out", "l.zarr", cwd=folder)
    store = opened(folder / "l.zarr")
    assert store.x.nbytes > 200e6
    assert large - small < 100.0
    for case in (0, 125, 249):
        exact = 2.0 * (1.0 - np.exp(-store.time.values / float(store.tau[case])))
        assert np.abs(store.x.isel(tau=case).values - exact).max() < 1e-9
    shutil.rmtree(folder / "l.zarr")


def test_traces_are_read_where_they_are_used(folder, tmp_path):
    """Traces of several outputs over a grid are those in memory, whatever is read of them."""
    over, driven = {"R1": "0.3..0.7:4", "C": [5.0, 10.0, 20.0]}, {"current": np.sin(TIME)}
    call = {"time": TIME, "keep": ["last", "trace"]}
    lazy = ppy.sweep("ppy_actuator", over, driven, **call, folder=tmp_path / "part")
    whole = ppy.sweep("ppy_actuator", over, driven, **call)
    assert lazy.identical(whole)
    alone = ppy.simulate("ppy_actuator", driven, time=TIME, settings={"R1": 0.7, "C": 10.0})
    for name in ("voltage", "charge", "displacement"):
        one, other = lazy[name], whole[name].values
        assert one[3, 1].values == pytest.approx(alone[name], rel=1e-9, abs=1e-15)
        assert one[2, 1].values.tolist() == other[2, 1].tolist()
        assert one[1:3, ::-1, 5:40:7].values.tolist() == other[1:3, ::-1, 5:40:7].tolist()
        assert one[:, :, ::-3].values.tolist() == other[:, :, ::-3].tolist()
        assert one[[3, 0, 3], [2], 4].values.tolist() == other[[3, 0, 3]][:, [2]][:, :, 4].tolist()
        assert one[:0].values.shape == (0, 3, 51)
    assert lazy.chunk(R1=1)["voltage"].mean().compute().item() == pytest.approx(
        whole["voltage"].values.mean()
    )


def test_without_zarr_it_is_told_before_anything_runs(folder, monkeypatch):
    monkeypatch.setitem(sys.modules, "zarr", None)
    with pytest.raises(UserError, match=r'writing Zarr needs zarr: pip install "ppy-rig\[zarr\]"'):
        stored.check(folder / "x.zarr")
    done = here(*CALL, "--over", "tau=0.5..2:4", "--out", "x.zarr", cwd=folder)
    assert done.returncode == 2
    assert not (folder / "x.zarr.part").exists()


def test_a_full_disk_is_told_in_a_line(folder, tmp_path, monkeypatch):
    def full(*given, **more):
        raise OSError(28, "No space left on device")

    data = ppy.sweep(str(folder / "one_state.fmu"), {"tau": [1.0, 2.0]}, time=TIME, keep=["trace"])
    monkeypatch.setattr(xarray.Dataset, "to_zarr", full)
    with pytest.raises(UserError, match=r"cannot write .*a.zarr: No space left on device"):
        stored.write(data, tmp_path / "a.zarr")
    assert [*tmp_path.iterdir()] == []
