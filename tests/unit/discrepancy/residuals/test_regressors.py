"""What a residual may depend on: names, values and units of what is made of signals."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.residuals.regressors import RegressorKind, make_regressors


def test_what_may_explain():
    time = np.array([0.0, 1.0, 3.0])
    inputs = {"u": np.array([1.0, -2.0, 5.0]), "still": np.ones(3)}
    units = {"u": "A", "x": "1", "still": "N"}
    known = {
        s.name: s
        for s in make_regressors(time, inputs, {"x": np.array([0.0, 1.0, 5.0])}, {}, units)
    }
    assert list(known) == [
        "u",
        "integral of |u|",
        "integral of |still|",
        "x",
        "square of x",
        "rate of x",
        "time",
    ]
    assert known["integral of |u|"].values == pytest.approx([0.0, 1.0, 5.0])
    assert known["integral of |u|"].unit == "A·s"
    assert known["rate of x"].unit == "1/s"
    assert [s.name for s in known.values() if s.kind is RegressorKind.SQUARE] == ["square of x"]
    assert {s.signal for s in known.values()} == {"u", "still", "x", "time"}


def test_an_output_counts_by_its_speed():
    time = np.array([0.0, 1.0, 2.0, 3.0])
    outputs = {"y": np.array([0.0, -2.0, -4.0, -6.0]), "z": np.array([0.0, -1.0, -4.0, -9.0])}
    known = {s.name: s for s in make_regressors(time, {}, {}, outputs, {"y": "V", "z": "V"})}
    assert list(known) == ["speed of z", "time"]  # that of y does not vary
    assert known["speed of z"].values == pytest.approx(np.abs(np.gradient(outputs["z"], time)))
    assert known["speed of z"].unit == "V/s"
