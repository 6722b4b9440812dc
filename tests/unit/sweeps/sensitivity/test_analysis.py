"""Analyses of sweeps: refusals of failed cases and of other designs, and pictures."""

from __future__ import annotations

import numpy as np
import pytest
import xarray

import orchestration as ppy
from fmus.kit import UserError
from orchestration.reporting.console import plain_text
from orchestration.sweeps.sensitivity import indices
from orchestration.sweeps.sensitivity import one_at_a_time as tornado
from tests.support.command import here
from tests.support.hosts import MINIMAL_PYTHONFMU_SOURCE, build_one_state_fmu, build_pythonfmu
from tests.support.sensitivity_laws import TIME, Laws, swept


@pytest.fixture(scope="module")
def fragile(tmp_path_factory):
    """Return an FMU that refuses a step where its input is 5 and more."""
    step = "    def do_step(self, current_time, step_size):\n"
    source = MINIMAL_PYTHONFMU_SOURCE.replace(
        step, step + "        if self.u >= 5.0:\n            return False\n"
    )
    folder = tmp_path_factory.mktemp("fragile")
    return str(build_pythonfmu(folder, "refusing_most", source.replace("Minimal", "RefusingMost")))


def test_nothing_stands_in_for_a_case_that_failed(fragile):
    found = swept(fragile, {"u": "1..6"}, samples=16)
    count = int((found["failure"].values != "").sum())
    assert 0 < count < 48
    with pytest.raises(
        UserError,
        match=rf"no Sobol indices: {count} of 48 cases failed.*asks to end the simulation",
    ) as told:
        ppy.sensitivity(found)
    assert "\n" not in str(told.value)
    moved = ppy.tornado(swept(fragile, {"u": "0..6"}, kind="tornado", samples=None))
    assert np.isfinite(moved["x_last_tornado"].values[0]).tolist() == [True, False]
    assert [*tornado.table(moved).columns][6]._cells == ["failed"]
    with pytest.raises(UserError, match=r"no tornado plot.*cases failed"):
        ppy.tornado(
            swept(fragile, {"u": "0..6"}, settings={"u": 5.5}, kind="tornado", samples=None)
        )


@pytest.mark.parametrize(
    ("call", "told"),
    [
        ({"samples": 100}, "powers of two"),
        ({"samples": 1}, "samples=1: kind='sobol-indices' needs 16 or more"),
        ({"samples": 8}, "samples=8: kind='sobol-indices' needs 16 or more"),
        ({"samples": None}, "needs samples="),
        ({"samples": 2**26}, "at most"),
        ({"keep": ["trace"]}, "asks for numbers"),
        ({"over": {"a": [1.0, 2.0]}}, "write from..to"),
        ({"over": {"a": [1.0, 2.0]}, "kind": "tornado", "samples": None}, "write from..to"),
        ({"kind": "tornado"}, "has its own values"),
        ({"settings": {"a": 1.0}}, "swept, and set"),
        ({"seed": -1}, "seed=-1: from 0 on"),
    ],
)
def test_what_does_not_go_together_is_told_before_anything_runs(call, told):
    with pytest.raises(UserError, match=told):
        swept(Laws, call.pop("over", {"a": "1..2", "b": "2..3"}), **call)


def test_another_sweep_has_neither():
    found = ppy.sweep(Laws, {"a": "1..2:3"}, time=TIME)
    for analyse in (ppy.sensitivity, ppy.tornado):
        with pytest.raises(UserError, match="the dataset is of grid"):
            analyse(found)
    part = swept(Laws, {"a": "1..2", "b": "2..3"}).isel(case=slice(7))
    with pytest.raises(UserError, match="7 cases are not all"):
        ppy.sensitivity(part)
    with pytest.raises(UserError, match="level 95"):
        ppy.sensitivity(part, level=95)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sensitivity")
    build_one_state_fmu(folder)
    return folder


def test_cases_are_kept_where_indices_are_refused(fragile, tmp_path):
    call = (
        "sweep",
        fragile,
        "--over",
        "u=1..6",
        "--design",
        "sobol-indices",
        "--samples",
        16,
        "--stop",
        "1s",
    )
    ended = here(*call, "--keep", "last", "--out", "f.nc", cwd=tmp_path)
    assert ended.returncode == 2
    assert "error: no Sobol indices: " in ended.stderr
    assert "Traceback" not in ended.stderr
    read = xarray.load_dataset(tmp_path / "f.nc", engine="scipy")
    assert read["x_last"].shape == (48,)
    assert not (tmp_path / "f.nc.part").exists()


def test_a_tornado_and_its_table_are_in_display_units():
    """Displacement in mm as `ppy simulate` shows it, of a spring whose law is known by heart."""
    over = {"k1": "4N/mm..8N/mm"}
    found = ppy.sweep(
        "ppy_actuator",
        over,
        {"force": 2.0},
        stop=0.1,
        step=0.1,
        kind="tornado",
        outputs=["mechanical_displacement"],
        keep=["smallest"],
        settings={"k1": "5 N/mm"},
    )
    panel = tornado.draw(ppy.tornado(found)).axes[0]
    assert panel.get_xlabel() == "mechanical displacement smallest [mm]"
    ends = sorted(bar.get_x() + bar.get_width() for bar in panel.patches)
    assert ends == pytest.approx([2.0 / 8.0, 2.0 / 4.0])
    (line,) = [
        line for line in plain_text(tornado.table(ppy.tornado(found))).splitlines() if "k1" in line
    ]
    assert line.split()[-4:] == ["0.4", "0.5", "0.25", "mm"]


def test_pictures_have_bars_as_long_as_the_numbers():
    """The bars are read off the figure."""
    shares = ppy.sensitivity(
        swept(Laws, {"a": "1..2", "b": "0..3"}, samples=64, outputs=["linear"])
    )
    (panel,) = indices.draw(shares).axes
    bars = sorted((bar.get_x(), bar.get_height()) for bar in panel.patches)
    assert [h for _, h in bars] == pytest.approx(shares["linear_last_index"].values.T.ravel())
    moved = ppy.tornado(
        swept(Laws, {"u": "3..6"}, kind="tornado", samples=None, outputs=["product"])
    )
    (panel,) = tornado.draw(moved).axes
    reached = sorted(bar.get_x() + bar.get_width() for bar in panel.patches)
    assert reached == pytest.approx([9.0, 18.0])
