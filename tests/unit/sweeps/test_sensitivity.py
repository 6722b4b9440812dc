"""Sobol indices and tornado plots. Oracles: the function of Ishigami, a linear and a bilinear law, in closed form."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest
import xarray

import orchestration as ppy
from fmus.kit import Component, Input, Output, Parameter, UserError, sin
from orchestration.sweeps.sensitivity import indices, tornado
from tests.support.command import PNG, here, works
from tests.support.hosts import MINIMAL_PYTHONFMU_SOURCE, build_one_state_fmu, build_pythonfmu

TIME = np.array([0.0, 1.0])


class Ishigami(Component):
    """Ishigami and Homma, 1990: not monotonic, and its third parameter acts together with the first only."""

    name = "ishigami"
    x1 = Parameter(0.0, "1", doc="first")
    x2 = Parameter(0.0, "1", doc="second")
    x3 = Parameter(0.0, "1", doc="third")

    @Output("1", nominal=1.0)
    def y(self):
        """Of it."""
        return sin(self.x1) + 7.0 * sin(self.x2) * sin(self.x2) + 0.1 * self.x3**4 * sin(self.x1)


class Laws(Component):
    """A linear law, a bilinear one, and one that hangs on nothing."""

    name = "laws_of_sensitivity"
    a = Parameter(2.0, "V", doc="offset")
    b = Parameter(3.0, "ohm", doc="resistance")
    c = Parameter(1.0, "1", min=0.1, doc="factor")
    u = Input("A", start=4.0, doc="current")

    @Output("V", nominal=1.0)
    def linear(self):
        """Of all."""
        return 2.0 * self.a + self.b - 4.0 * self.c

    @Output("V", nominal=1.0)
    def product(self):
        """Of two."""
        return self.b * self.u

    @Output("V", nominal=1.0)
    def still(self):
        """Of nothing."""
        return 7.0 + 0.0 * self.a


def ishigami_exact():
    a, b = 7.0, 0.1
    first = 0.5 * (1.0 + b * np.pi**4 / 5.0) ** 2
    second, both = a**2 / 8.0, b**2 * np.pi**8 * (1.0 / 18.0 - 1.0 / 50.0)
    whole = first + second + both
    return np.array([[first, second, 0.0], [first + both, second, both]]) / whole


def swept(model, over, **more):
    return ppy.sweep(
        model, over, time=TIME, **{"keep": ["last"], "kind": "sobol-indices", "samples": 64} | more
    )


def test_indices_of_ishigami_are_those_of_the_closed_form():
    over = dict.fromkeys(("x1", "x2", "x3"), f"{-np.pi}..{np.pi}")
    found = swept(Ishigami, over, samples=8192)
    assert found.sizes["case"] == 5 * 8192
    shares = ppy.sensitivity(found)
    assert shares["y_last_index"].dims == ("index", "parameter")
    assert shares["y_last_index"].sel(
        index=["first", "total"], parameter=["x1", "x2", "x3"]
    ).values == pytest.approx(ishigami_exact(), abs=0.01)


def test_indices_of_a_linear_law_are_its_shares_of_the_variance():
    """Of ``sum a_i x_i`` they are ``a_i^2 var(x_i)``, first as total; here each as ``a_i`` times the width, squared."""
    over = {"a": "1..2", "b": "0..3", "c": "0.5..1"}
    found = ppy.sensitivity(swept(Laws, over, samples=1024))
    weight = np.array([2.0 * 1.0, 1.0 * 3.0, 4.0 * 0.5]) ** 2
    for order in ("first", "total"):
        assert found["linear_last_index"].sel(index=order).values == pytest.approx(
            weight / weight.sum(), abs=0.01
        )
    assert np.isnan(found["still_last_index"].values).all()
    assert found["linear_last_index"].units == "1"


def test_parameters_over_ratios_vary_evenly_in_their_logarithm():
    """Of one parameter ``x`` over ratios r the mean is ``(r - 1) / ln r``; the cases tell it."""
    found = swept(Laws, {"c": "0.1..10 log", "b": "1..2"}, samples=1024)
    assert found["c"].values.mean() == pytest.approx(9.9 / np.log(100.0), rel=0.01)


@pytest.mark.parametrize("level", [0.95, 0.5])
def test_intervals_are_those_of_the_bootstrap(level):
    """Of the estimators of Saltelli et al. (2010, table 2, b and f), written out here; wider than the truth needs."""
    over, samples = {"a": "1..2", "b": "0..3", "c": "0.5..1"}, 256
    found = swept(Laws, over, samples=samples, outputs=["linear"])
    values = found["linear_last"].values.reshape(samples, 5)
    whole = values - values.mean()
    chosen = np.random.default_rng(5).integers(samples, size=(4000, samples))
    picked = whole[chosen]  # resample, base point, A | AB | B
    a, ab, b = picked[..., :1], picked[..., 1:-1], picked[..., -1:]
    spread = np.concatenate([a, b], axis=1).var(axis=1)
    first, total = (b * (ab - a)).mean(axis=1) / spread, 0.5 * ((a - ab) ** 2).mean(axis=1) / spread
    shares = ppy.sensitivity(found, level=level)
    ends = shares["linear_last_index_interval"]
    half = 0.5 * (ends.sel(end="upper") - ends.sel(end="lower")).values
    factor = {0.95: 1.95996, 0.5: 0.67449}[level]
    assert half == pytest.approx(factor * np.array([first.std(axis=0), total.std(axis=0)]), rel=0.1)
    weight = np.array([4.0, 9.0, 4.0]) / 17.0
    assert (np.abs(shares["linear_last_index"].values - weight) < half).all()


def test_the_same_seed_comes_to_the_same_indices():
    over = {"a": "1..2", "b": "0..3"}
    one, again, other = (ppy.sensitivity(swept(Laws, over, seed=s), seed=s) for s in (0, 0, 1))
    assert one.identical(again)
    assert not one.equals(other)


def test_a_tornado_is_that_of_the_closed_form():
    over = {"a": "1..2", "b": "2..5", "u": "3..6"}
    call = {"kind": "tornado", "samples": None}
    found = ppy.tornado(swept(Laws, over, settings={"b": 4.0}, **call))
    assert float(found["product_last_start"]) == pytest.approx(16.0)
    expected = {"a": [16.0, 16.0], "b": [8.0, 20.0], "u": [12.0, 24.0]}
    for parameter, ends in expected.items():
        assert found["product_last_tornado"].sel(parameter=parameter).values == pytest.approx(ends)
    assert found["linear_last_tornado"].sel(parameter="a", end="from").item() == pytest.approx(
        2.0 + 4.0 - 4.0
    )
    assert found["ends"].sel(parameter="b").values.tolist() == [2.0, 5.0]
    assert (found["product_last_tornado"].units, found["parameter_units"].values.tolist()) == (
        "V",
        ["V", "ohm", "A"],
    )
    with pytest.raises(UserError, match=r"b=5..7: its start value 3 ohm is not among these"):
        swept(Laws, {"b": "5..7"}, **call)


def test_what_moves_most_stands_first():
    found = ppy.tornado(
        swept(Laws, {"a": "1..2", "u": "3..6", "b": "2..5"}, kind="tornado", samples=None)
    )
    rows = [*zip(*(column.cells for column in tornado.table(found).columns), strict=True)]
    assert [r[1] for r in rows if r[0] == "product_last"] == ["b", "u", "a"]
    assert [r[1] for r in rows if r[0] == "linear_last"] == ["b", "a", "u"]
    assert rows[[r[:2] for r in rows].index(("product_last", "u"))][2:] == (
        "3 A",
        "6 A",
        "12",
        "9",
        "18",
        "V",
    )


@pytest.fixture(scope="module")
def fragile(tmp_path_factory):
    """An FMU that refuses a step where its input is 5 and more."""
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
        UserError, match=rf"no Sobol indices: {count} of 48 cases failed.*step from 0 s failed"
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
        ({"samples": 1}, "--samples 1: --design sobol-indices takes 16 or more"),
        ({"samples": 8}, "--samples 8: --design sobol-indices takes 16 or more"),
        ({"samples": None}, "needs --samples"),
        ({"samples": 2**26}, "at most"),
        ({"keep": ["trace"]}, "asks for numbers"),
        ({"over": {"a": [1.0, 2.0]}}, "write from..to"),
        ({"over": {"a": [1.0, 2.0]}, "kind": "tornado", "samples": None}, "write from..to"),
        ({"kind": "tornado"}, "has its own values"),
        ({"settings": {"a": 1.0}}, "swept, and set"),
        ({"seed": -1}, "zero or more"),
    ],
)
def test_what_does_not_go_together_is_told_before_anything_runs(call, told):
    with pytest.raises(UserError, match=told):
        swept(Laws, call.pop("over", {"a": "1..2", "b": "2..3"}), **call)


def test_another_sweep_has_neither():
    found = ppy.sweep(Laws, {"a": "1..2:3"}, time=TIME)
    for analyse in (ppy.sensitivity, ppy.tornado):
        with pytest.raises(UserError, match="not grid"):
            analyse(found)
    part = swept(Laws, {"a": "1..2", "b": "2..3"}).isel(case=slice(7))
    with pytest.raises(UserError, match="7 cases are not all"):
        ppy.sensitivity(part)
    with pytest.raises(UserError, match="level 95"):
        ppy.sensitivity(part, level=95)


# --- on the command line ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sensitivity")
    build_one_state_fmu(folder)
    return folder


CALL = (
    "sweep",
    "one_state.fmu",
    "--set",
    "u=2",
    "--stop",
    "1s",
    "--step",
    "0.1s",
    "--over",
    "tau=0.5..2",
)


def words(picture):
    """What is written in a picture; its texts are drawn as glyphs beside comments that say them."""
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    tree = ElementTree.parse(picture, parser)
    return [
        str(element.text).strip() for element in tree.iter() if element.tag is ElementTree.Comment
    ]


def test_indices_are_printed_written_and_drawn(folder):
    call = [
        *CALL[:2],
        *CALL[4:],
        "--over",
        "u=1..2",
        "--design",
        "sobol-indices",
        "--samples",
        "64",
    ]
    said = works(*call, "--keep", "last", "--out", "i.nc", "--plot", "i.svg", cwd=folder)
    assert "256 cases" in said
    assert "95 % interval" in said
    read = xarray.load_dataset(folder / "i.nc", engine="scipy")
    again = ppy.sensitivity(read)
    xarray.testing.assert_allclose(read["x_last_index"], again["x_last_index"])
    assert {"tau", "u", "first order", "total", "x last", "parameter"} <= {*words(folder / "i.svg")}
    one = next(
        line.split() for line in said.splitlines() if line.startswith("x_last") and " tau " in line
    )
    assert float(one[2]) == pytest.approx(
        float(again["x_last_index"].sel(index="first", parameter="tau")), abs=6e-4
    )


def test_a_tornado_is_printed_written_and_drawn(folder):
    """``x(1) = u (1 - exp(-1 / tau))``."""
    call = [*CALL, "--over", "u=1..3", "--design", "tornado", "--keep", "last", "--set", "tau=1"]
    said = works(*call, "--out", "t.nc", "--plot", "t.svg", cwd=folder)
    works(*call, "--plot", "t.png", cwd=folder)
    assert (folder / "t.png").read_bytes().startswith(PNG)
    read = xarray.load_dataset(folder / "t.nc", engine="scipy")
    exact = 2.0 * (1.0 - np.exp(-1.0 / np.array([0.5, 2.0])))
    assert read["x_last_tornado"].sel(parameter="tau").values == pytest.approx(exact)
    assert f"{exact[0]:.6g}" in said
    assert {"tau: 0.5..2 s", "low end of the range", "x last"} <= {*words(folder / "t.svg")}


def test_a_file_says_where_the_others_stay(folder):
    (folder / "t.toml").write_text(
        'design = "tornado"\nkeep = ["last"]\n[experiment]\ncomponent = "one_state.fmu"\nduration = "1 s"\n'
        'step = "100 ms"\nparameters.tau = 0.7\ninputs.u = { kind = "constant", value = 2 }\n[over]\ntau = "0.5..2"\n'
    )
    found = ppy.tornado(ppy.sweep_file(folder / "t.toml"))
    assert float(found["x_last_start"]) == pytest.approx(2.0 * (1.0 - np.exp(-1.0 / 0.7)))


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


def test_pictures_have_bars_as_long_as_the_numbers(tmp_path, monkeypatch):
    """What is drawn, read off the figure that is saved."""
    drawn = []
    monkeypatch.setattr(indices.pictures, "save", lambda figure, path: drawn.append(figure))
    shares = ppy.sensitivity(
        swept(Laws, {"a": "1..2", "b": "0..3"}, samples=64, outputs=["linear"])
    )
    indices.draw(shares, tmp_path / "a.png")
    bars = sorted((bar.get_x(), bar.get_height()) for bar in drawn[0].axes[0].patches)
    assert [h for _, h in bars] == pytest.approx(shares["linear_last_index"].values.T.ravel())
    moved = ppy.tornado(
        swept(Laws, {"u": "3..6"}, kind="tornado", samples=None, outputs=["product"])
    )
    tornado.draw(moved, tmp_path / "b.png")
    reached = sorted(bar.get_x() + bar.get_width() for bar in drawn[1].axes[0].patches)
    assert reached == pytest.approx([9.0, 18.0])
