"""Claims: intervals of R1, R2 and C hold, and least squares is biased as theory says.

Oracles: the circuit discretised by scipy, the limit of the normal matrix in noise, binomial bounds.
"""

from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter
from scipy.stats import binom

from demonstrations.graphical.circuit import read_circuit
from demonstrations.graphical.impedance import tustin
from fmus import component
from fmus.kit.errors import UserError
from orchestration.identify import parameter_set
from tests.support.command import PNG
from tests.support.pace import slow_but

R1, R2, C = TRUE = 0.43, 2.35, 2.70  # ohm, ohm, F
STEP, NOISE = 0.1, 20e-3  # s, V
NUMERATOR, DENOMINATOR, _ = cont2discrete(([R1 * R2 * C, R2], [(R1 + R2) * C, 1.0]), STEP, "zoh")


def record(samples=2000, seed=0, noise=NOISE):
    time = STEP * np.arange(samples)
    current = np.where(time % 5.0 < 2.4999, 0.9, -0.9)
    clean = lfilter(NUMERATOR[0], DENOMINATOR, current)
    return time, current, clean + noise * np.random.default_rng(seed).standard_normal(samples)


def quantities(circuit):
    return [circuit.R1, circuit.R2, circuit.C]


def test_without_noise_both_are_exact():
    (window,) = read_circuit(*record(noise=0.0)).windows
    for circuit in window.estimators.values():
        assert [q.value for q in quantities(circuit)] == pytest.approx(TRUE, rel=1e-6)
        assert [q.unit for q in quantities(circuit)] == ["ohm", "ohm", "F"]


@pytest.mark.slow
def test_intervals_of_the_one_without_bias_hold_the_truth():
    """Of 100 records: 95 %, within what chance allows; least squares holds it in none."""
    draws, held, biased = 100, np.zeros(3, dtype=int), np.zeros(3, dtype=int)
    for seed in range(draws):
        (window,) = read_circuit(*record(1000, seed)).windows
        held += [
            q.interval[0] <= x <= q.interval[1]
            for q, x in zip(quantities(window.output_error), TRUE, strict=True)
        ]
        biased += [
            q.interval[0] <= x <= q.interval[1]
            for q, x in zip(quantities(window.least_squares), TRUE, strict=True)
        ]
    low, high = binom.interval(0.998, draws, 0.95)
    print("held, in %:", 100.0 * held / draws, "by least squares:", 100.0 * biased / draws)
    assert ((held >= low) & (held <= high)).all()
    assert (biased < 0.5 * draws).all()


def test_least_squares_is_biased_as_theory_says():
    """Compare with the limit of the normal matrix.

    Noise adds its variance to one element of it, and nothing to the right-hand side.
    """
    _, current, voltage = record(60_000, noise=0.0)
    rows = np.column_stack([current[1:], current[:-1], -voltage[:-1]])
    normal, right = rows.T @ rows / len(rows), rows.T @ voltage[1:] / len(rows)
    normal[2, 2] += NOISE**2
    b0, b1, a = np.linalg.solve(normal, right)
    r1, r2 = b0 * (b0 + b1) / (b1 - a * b0), (b0 + b1) / (1.0 + a)
    expected = [r1, r2, -STEP / (np.log(-a) * (r1 + r2))]
    (window,) = read_circuit(*record(60_000)).windows
    assert expected[1] < 1.4
    assert [q.value for q in quantities(window.least_squares)] == pytest.approx(expected, rel=0.03)
    assert [q.value for q in quantities(window.output_error)] == pytest.approx(TRUE, rel=0.01)


def test_the_interval_is_the_delta_method_s():
    """Compare with standard errors from the closed form.

    They are from sensitivities of the response by R1, R2 and C themselves.
    """

    def response(circuit):
        r1, r2, c = circuit
        above, below, _ = cont2discrete(([r1 * r2 * c, r2], [(r1 + r2) * c, 1.0]), STEP, "zoh")
        return lfilter(above[0], below, current)

    time, current, voltage = record()
    slopes = np.array(
        [
            (response(np.array(TRUE) + h) - response(np.array(TRUE) - h)) / 2e-5
            for h in 1e-5 * np.eye(3)
        ]
    ).T
    # what the circuit was charged with before the record is estimated, too
    free = lfilter([1.0], DENOMINATOR, np.eye(len(time), 1)[:, 0])
    errors = NOISE * np.sqrt(
        np.diag(np.linalg.inv(np.column_stack([slopes, free]).T @ np.column_stack([slopes, free])))
    )
    found = quantities(read_circuit(time, current, voltage).windows[0].output_error)
    half = [
        0.5 * np.log(q.interval[1] / q.interval[0]) * x for q, x in zip(found, TRUE, strict=True)
    ]
    assert half == pytest.approx(1.96 * errors[:3], rel=0.15)


def test_windows_follow_a_circuit_that_changes():
    (_, current, before), (_, _, after) = record(1000), record(1000, 1)
    reading = read_circuit(
        np.arange(2000) * STEP, np.tile(current, 2), np.r_[before, 2.0 * after], 100.0
    )
    assert [(w.start, w.end) for w in reading.windows] == [
        pytest.approx((0, 100)),
        pytest.approx((100, 200)),
    ]
    assert reading.values["R1"] == pytest.approx(2.0 * R1, rel=0.1)
    assert reading.windows[0].output_error.R1.value == pytest.approx(R1, rel=0.1)


def test_tustin_s_rule_is_there_as_printed():
    time, current, voltage = record(noise=0.0)
    printed = read_circuit(time, current, voltage, conversion=tustin)
    assert [printed.values[n] for n in ("R1", "R2", "C")] == pytest.approx(
        (0.412, 2.350, 2.718), abs=6e-4
    )  # errata 8


def test_it_is_told_drawn_and_written(tmp_path):
    reading = read_circuit(*record(), 50.0)
    assert str(reading).count("R2 = ") == 8
    assert "biased by the noise of 2" in str(reading)
    assert reading.windows[3].output_error.C.unit == "F"
    assert reading.noise == pytest.approx(NOISE, rel=0.1)
    figure = reading.plot(tmp_path / "circuit.png")
    assert (tmp_path / "circuit.png").read_bytes().startswith(PNG)
    assert [axis.get_ylabel() for axis in figure.axes] == ["R1\n[Ω]", "R2\n[Ω]", "C\n[F]"]
    parameters = {p.name: p for p in component("ppy_actuator").layout.parameters}
    parameter_set.write(tmp_path / "circuit.ssv", reading.values, parameters, "200 s")
    named = [
        e.get("name")
        for e in ElementTree.parse(tmp_path / "circuit.ssv").iter()
        if e.get("name") in reading.values
    ]
    assert named == ["R1", "R2", "C"]


def test_where_there_is_no_circuit_that_is_said(tmp_path):
    time, current, voltage = record()
    reading = read_circuit(time, current, -voltage)
    assert len(reading.warnings) == 2
    assert "no circuit behaves so" in str(reading)
    reading.plot(tmp_path / "none.png")
    with pytest.raises(UserError, match="no finite number"):
        parameter_set.write(
            tmp_path / "no.ssv", reading.values, {"R1": None, "R2": None, "C": None}
        )


@pytest.mark.slow
@pytest.mark.parametrize("resistance", slow_but([0.4, 7.0, 1e3], 0.4))
def test_a_resistor_is_no_circuit(resistance):
    """Without noise, and with so little that it is rounding beside the voltage."""
    time = STEP * np.arange(2000)
    for current in (record()[1], np.random.default_rng(0).normal(size=2000)):
        for noise in (0.0, 1e-12 * resistance):
            voltage = resistance * current + noise * np.random.default_rng(1).normal(size=2000)
            reading = read_circuit(time, current, voltage)
            assert [c.exists for c in reading.windows[0].estimators.values()] == [False, False]
            assert len(reading.warnings) == 2
            assert all("no circuit behaves as" in text for text in reading.warnings)


def test_a_capacitor_that_is_nearly_ideal_is_no_circuit():
    """A pole at 1 - 1e-9: in 200 s nothing leaks away through R2."""
    time, current, _ = record()
    leak = 1.0 - 1e-9
    voltage = 0.4 * current + lfilter([0.0, STEP / C], [1.0, -leak], current)
    reading = read_circuit(time, current, voltage)
    assert not reading.windows[0].least_squares.exists
    assert "no circuit behaves as least squares has it" in " ".join(reading.warnings)


@pytest.mark.parametrize("decay", [1e-3, 0.9999])
def test_a_fast_and_a_slow_circuit_are_circuits(decay):
    """Time constants of 14 ms and of 1000 s, without noise."""
    time, current, _ = record()
    c = -STEP / (np.log(decay) * (R1 + R2))
    above, below, _ = cont2discrete(([R1 * R2 * c, R2], [(R1 + R2) * c, 1.0]), STEP, "zoh")
    reading = read_circuit(time, current, lfilter(above[0], below, current))
    assert [q.value for q in quantities(reading.windows[0].least_squares)] == pytest.approx(
        (R1, R2, c), rel=1e-6
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"current": np.zeros(2000)}, "window from 0 s to 200 s: input current is constant"),
        ({"voltage": np.full(2000, np.nan)}, "voltage: sample 0 is nan"),
        ({"time": np.arange(2000.0) ** 1.1}, "is not where equal steps of"),
        ({"window": 1.0}, "10 samples of 0.1 s: it needs 12"),
        ({"window": 500.0}, "record of 200 s: shorter than a window of 500 s"),
        ({"window": np.nan}, "a window of nan s: write a finite length above 0"),
        ({"window": -5.0}, "a window of -5 s: write a finite length above 0"),
        ({"window": np.inf}, "a window of inf s: write a finite length above 0"),
    ],
    ids=lambda value: "-".join(value) if isinstance(value, dict) else "",
)
def test_what_cannot_be_read_is_refused(change, message):
    given = dict(zip(("time", "current", "voltage"), record(), strict=True)) | change
    with pytest.raises(UserError) as caught:
        read_circuit(**given)
    assert message in str(caught.value)
