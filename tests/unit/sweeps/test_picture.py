"""Claims: a sweep and its analyses are drawn as what they are, and a part of one is not."""

from __future__ import annotations

import pytest

import orchestration as ppy
from fmus.kit import UserError


@pytest.fixture(scope="module")
def swept(lag):
    def sweep(over, keep="last", **options):
        return ppy.sweep(lag, over, stop="2s", step="100 ms", keep=keep, **options)

    return sweep


def test_an_analysis_is_drawn_as_what_it_is(swept):
    over = {"tau": "1..2", "u": "1..3"}
    moved = ppy.tornado(swept(over, kind="tornado", settings={"u": 2.0, "tau": 1.5}))
    assert [one.get_text() for one in moved.plot().axes[0].get_yticklabels()] == [
        "tau: 1..2 s",
        "u: 1..3",
    ]
    shares = ppy.sensitivity(swept(over, kind="sobol-indices", samples=16))
    assert shares.plot().axes[0].get_xlabel() == "parameter"
    bands = ppy.bands(swept(over, kind="sobol", samples=16))
    with pytest.raises(UserError, match="bands are drawn over time"):
        bands.plot()  # of numbers
    for one in (moved, shares):
        assert one._repr_mimebundle_()["image/png"]
    assert list(bands._repr_mimebundle_()) == ["text/html"]


def test_a_part_has_no_picture(swept):
    found = swept({"tau": "1, 2", "u": "1, 3"})
    with pytest.raises(UserError, match="part of a sweep"):
        found.sel(u=3.0).plot()
    assert list(found.sel(u=3.0)._repr_mimebundle_()) == ["text/html"]
