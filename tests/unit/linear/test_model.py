"""Claims: responses, margins, poles and zeros are those of closed forms, and all of it is written.

Oracles: transfer functions on paper, scipy's discretisation and reader of MATLAB files.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.io import loadmat
from scipy.signal import cont2discrete

from fmus.kit import UserError
from orchestration.linear.discretisation import Matrices
from orchestration.linear.model import LinearModel, w_plane
from orchestration.linear.operating_point import OperatingPoint

POINT = OperatingPoint(1.0, {"k": 2.0}, {"a.u": 0.5}, {"x1": 1.0, "x2": 0.0}, {})


def model(A, B, C, D, period=0.0, loop=""):
    """A model from `a.u` to `y` with states x1, x2, ..."""
    A, B, C, D = (np.array(m, dtype=float) for m in (A, B, C, D))
    states = tuple(f"x{k + 1}" for k in range(len(A)))
    units = {"a.u": "A", "y": "V"}
    matrices = Matrices(A, B, C, D, period, states)
    return LinearModel("m", matrices, ("a.u",), ("y",), units, POINT, "paper", loop)


def third_order(gain):
    """The loop ``gain / (s (s + 1) (s + 2))``."""
    A = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -2.0, -3.0]]
    return model(A, [[0.0], [0.0], [gain]], [[1.0, 0.0, 0.0]], [[0.0]], loop="y")


def test_margins_of_a_loop_on_paper():
    # phase -180 degrees at sqrt 2 rad/s, where the gain is gain/6
    margins = third_order(2.0).margins()
    assert margins.gain == pytest.approx(3.0, rel=1e-9)
    assert margins.phase_crossover == pytest.approx(np.sqrt(2.0) / (2.0 * np.pi), rel=1e-9)
    omega = 2.0 * np.pi * margins.crossover
    assert omega * np.hypot(1.0, omega) * np.hypot(2.0, omega) == pytest.approx(2.0, rel=1e-9)
    phase = 90.0 - np.degrees(np.arctan(omega) + np.arctan(omega / 2.0))
    assert margins.phase == pytest.approx(phase, rel=1e-9)
    assert np.isinf(model([[-1.0]], [[1.0]], [[0.5]], [[0.0]]).margins().phase)


def sampled(continuous, period):
    m = continuous.matrices
    A, B, C, D, _ = cont2discrete((m.A, m.B, m.C, m.D), period)
    return model(A, B, C, D, period, continuous.loop)


def test_a_sampled_loop_has_the_delay_of_its_hold():
    # of 1/s, held for T: the phase is -90 - w T / 2, the gain T / (2 sin(w T / 2))
    T = 0.5
    margins = model([[1.0]], [[T]], [[1.0]], [[0.0]], T, "y").margins()
    half = np.arcsin(T / 2.0)
    assert margins.crossover == pytest.approx(half / (np.pi * T), rel=1e-9)
    assert margins.phase == pytest.approx(90.0 - np.degrees(half), rel=1e-9)
    # unstable from a gain of 2/T on, at half the sampling rate
    assert (margins.gain, margins.phase_crossover) == pytest.approx((2.0 / T, 0.5 / T), rel=1e-9)


def test_the_w_plane_is_tustins_rule_backwards():
    one = sampled(third_order(2.0), 0.1)
    w = 0.3j
    z = (1.0 + 0.05 * w) / (1.0 - 0.05 * w)
    assert w_plane(one.part())(w) == pytest.approx(one.part()(z), rel=1e-10)
    with pytest.raises(UserError, match="z = -1"):
        w_plane(model([[-1.0]], [[1.0]], [[1.0]], [[0.0]], 0.1).part())


def test_a_continuous_system_has_no_w_plane():
    with pytest.raises(UserError, match="a continuous system has no w-plane"):
        w_plane(third_order(2.0).state_space)


def test_responses_poles_and_zeros():
    # (s + 3) / (s + 1), as -1 x + 2 u and x + u
    lead = model([[-1.0]], [[2.0]], [[1.0]], [[1.0]])
    f = np.array([0.01, 1.0])
    s = 2j * np.pi * f
    np.testing.assert_allclose(lead.response(f), (s + 3.0) / (s + 1.0), rtol=1e-12)
    assert (lead.poles().tolist(), lead.zeros().tolist()) == ([-1.0], [-3.0])
    held = sampled(lead, 0.1)
    assert held.poles().tolist() == pytest.approx([np.exp(-0.1)])
    z = np.exp(s * 0.1)
    exact = 1.0 + 2.0 * (1.0 - np.exp(-0.1)) / (z - np.exp(-0.1))
    np.testing.assert_allclose(held.response(f), exact, rtol=1e-12)
    with pytest.raises(UserError, match="no input named 'u'"):
        lead.response(f, "u")
    with pytest.raises(UserError, match="no output named 'z'"):
        lead.zeros("a.u", "z")


def test_frequencies_go_over_poles_and_zeros_and_no_farther_than_half_the_rate():
    found = model([[-1.0]], [[2.0]], [[1.0]], [[1.0]]).frequencies(100)
    assert found[0] < 1.0 / (2.0 * np.pi) < 3.0 / (2.0 * np.pi) < found[-1]
    held = sampled(third_order(2.0), 0.1)
    assert held.frequencies()[-1] < 5.0
    # a zero that is at infinity but for rounding: 1 + 1e-12 s over s + 1
    far = model([[-1.0]], [[1.0]], [[1.0 - 1e-12]], [[1e-12]])
    assert far.frequencies()[-1] < 1e3


def test_python_control_gets_names_without_full_stops():
    space = model([[-1.0]], [[2.0]], [[1.0]], [[1.0]], 0.5).state_space
    assert (space.input_labels, space.state_labels, space.dt) == (["a/u"], ["x1"], 0.5)


def test_all_of_it_is_in_the_json():
    one = third_order(2.0)
    told = json.loads(json.dumps(one.to_dict()))
    assert told["A"] == one.matrices.A.tolist()
    assert told["inputs"] == [{"name": "a.u", "unit": "A"}]
    assert told["operating_point"]["values"] == {"a.u": 0.5, "x1": 1.0, "x2": 0.0}
    assert told["margins"]["gain"] == pytest.approx(3.0)
    assert sorted(pole[0] for pole in told["poles"]) == pytest.approx([-2.0, -1.0, 0.0], abs=1e-9)


def test_matlab_reads_matrices_names_and_units(tmp_path):
    one = sampled(third_order(2.0), 0.1)
    held = loadmat(one.to_mat(tmp_path / "m.mat"), simplify_cells=True)
    np.testing.assert_array_equal(held["A"], one.matrices.A)
    assert (held["Ts"], held["inputs"], held["outputs_units"]) == (0.1, "a.u", "V")
    assert held["states"].tolist() == ["x1", "x2", "x3"]


def test_another_ending_than_that_of_matlab_is_refused(tmp_path):
    with pytest.raises(UserError, match=r"cannot write .*m\.txt: its name must end in \.mat"):
        third_order(2.0).to_mat(tmp_path / "m.txt")
    assert list(tmp_path.iterdir()) == []


def test_the_text_tells_margins_poles_and_the_operating_point():
    text = str(third_order(2.0))
    assert "gain margin 3 at 0.2251 Hz" in text
    assert "phase margin" in text
    assert "m at 1 s, continuous, by paper" in text
    assert "-2" in text
    assert "gain margin without limit" in str(model([[0.0]], [[1.0]], [[1.0]], [[0.0]], loop="y"))
    later = replace(third_order(4.0), point=OperatingPoint(3.0, {}, {}, {}, {}))
    text = str(replace(third_order(2.0), further=(later,)))
    assert "also at 3 s: phase margin" in text
    assert "gain margin 1.5 at 0.2251 Hz" in text
    assert repr(third_order(2.0)) == "<LinearModel m at 1 s: a.u -> y>"


def test_a_family_has_its_values_margins_and_notes_each_and_a_band_its_range():
    gains = (1.0, 2.0, 4.0)
    point = OperatingPoint(0.0, {}, {}, {}, {})
    varied = tuple(
        replace(third_order(k), case={"k": k}, notes=(f"note {k}",), point=point) for k in gains
    )
    family = replace(third_order(2.0), variations=varied, units={"k": "V/m"})
    varied = tuple(replace(one, units={"k": "V/m"}) for one in varied)
    text = str(replace(family, variations=varied))
    assert "also k = 4 V/m: phase margin" in text
    assert "k = 4 V/m: note 4.0" in text
    summaries = family.to_dict()["variations"]
    assert [one["case"] for one in summaries] == [{"k": k} for k in gains]
    assert [one["margins"]["gain"] for one in summaries] == pytest.approx([6.0, 3.0, 1.5])
    many = str(replace(family, variations=varied * 3))
    phases = [one.margins().phase for one in varied]
    words = f"over 9 values of parameters: phase margin {min(phases):.1f} to {max(phases):.1f}°"
    assert words in many
    assert "also" not in many
    busy = tuple(replace(one, notes=("a", "b")) for one in varied)
    assert "3 more notes on these are in the JSON" in str(replace(family, variations=busy))
