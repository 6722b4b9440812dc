"""Claims: a sweep goes over values with units or as they are, and what does not go together is told
before anything runs.
"""

from __future__ import annotations

import numpy as np
import pytest

import orchestration as ppy
from fmus.kit import UserError

CALL = {"stop": 1.0, "step": 0.1}


def test_a_grid_is_the_closed_form_at_every_point(lag):
    """Over a parameter as a text, and an input that is held as values."""
    found = ppy.sweep(lag, {"tau": "0.5, 2000 ms", "u": [1.0, -3.0, 2.0]}, **CALL, keep=["last"])
    assert dict(found["x_last"].sizes) == {"tau": 2, "u": 3}
    exact = found.u.values * (1.0 - np.exp(-1.0 / found.tau.values[:, None]))
    assert found["x_last"].values == pytest.approx(exact)


def test_settings_and_inputs_are_those_of_every_case(lag):
    found = ppy.sweep(lag, {"u": [1.0]}, settings={"tau": "500 ms"}, **CALL)
    assert found["x_last"].values == pytest.approx(1.0 - np.exp(-2.0))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"workers": 0}, "workers 0: from 1 to"),
        ({"workers": 2, "scheduler": "tcp://h:1"}, "the cluster at tcp://h:1 has its own"),
        ({"outputs": ["y"]}, "no output named 'y'"),
        ({"settings": {"tau": 1.0}}, "tau is swept, and set to one value besides"),
        ({"keep": []}, "keep= names nothing"),
        ({"over": {"tua": [1.0]}}, "tua"),
    ],
)
def test_what_does_not_go_together_is_told_before_anything_runs(lag, options, said):
    ran = []
    over = options.pop("over", {"tau": [1.0, 2.0]})
    with pytest.raises(UserError, match=said):
        ppy.sweep(lag, over, **CALL, **options, check=lambda task, cases: ran.append(task))
    assert not ran


def test_a_file_says_what_is_swept_and_how_it_is_called(lag, tmp_path):
    text = f"""
title = "A lag"
keep = ["last"]
[experiment]
component = "{lag}"
duration = "1 s"
step = "100 ms"
inputs.u = 2
[over]
tau = "0.5..2:4"
"""
    (tmp_path / "lag.toml").write_text(text)
    found = ppy.sweep_file(tmp_path / "lag.toml")
    assert found.title == "A lag"
    assert found.tau.values == pytest.approx([0.5, 1.0, 1.5, 2.0])
    assert found["x_last"].values == pytest.approx(2.0 * (1.0 - np.exp(-1.0 / found.tau.values)))
