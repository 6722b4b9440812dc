"""Chapters 1 and 3 recomputed, against other computations than the project's own."""

import statistics

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import toeplitz
from scipy.optimize import minimize
from scipy.signal import lfilter, tf2ss

from demonstrations.thesis import actuator, circuit, identification
from tests.support.thesis_findings import claim, claims, row

pytestmark = pytest.mark.slow  # the first test computes the claims of a chapter

R1, R2, C = 0.43, 2.35, 2.7
TABLE = [  # table 3-1, typed in again
    ((0.3970, -0.3632, -0.9869), (0.45, 2.58, 2.50)),
    ((0.3648, -0.3321, -0.9839), (0.43, 2.02, 2.51)),
    ((0.3706, -0.3430, -0.9887), (0.42, 2.45, 3.1)),
]


def impedance(r1=R1, r2=R2, c=C):
    return control.tf([r1 * r2 * c, r2], [(r1 + r2) * c, 1.0])


def bilinear(b0, b1, a, period=0.1):
    """R1, R2 and C from where eq. 3.10 has its gain at rest, its gain at z = -1 and its pole."""
    r2, together = (b0 + b1) / (1 + a), (b0 - b1) / (1 - a)
    r1 = together * r2 / (r2 - together)
    pole = 2 / period * (-a - 1) / (-a + 1)
    return r1, r2, -1 / pole / (r1 + r2)


@pytest.mark.parametrize("number", [1, 2, 3])
def test_table_3_1_by_another_route(number):
    theta, entries = TABLE[number - 1]
    for name, value, entry in zip(("R1", "R2", "C"), bilinear(*theta), entries, strict=True):
        found = claim(identification, name, f"table 3-1, set {number}")
        assert found.reproduced == pytest.approx(value, rel=1e-9)
        assert float(found.published) == entry
        assert found.holds


def test_means_and_deviations_of_table_3_1():
    rows = [(*theta, *bilinear(*theta)) for theta, _ in TABLE]
    for name, column in zip(
        ("b0", "b1", "a", "R1", "R2", "C"), zip(*rows, strict=True), strict=True
    ):
        assert claim(identification, f"mean of {name}").reproduced == pytest.approx(
            statistics.mean(column), rel=1e-9
        )
        assert claim(identification, f"standard deviation of {name}").reproduced == pytest.approx(
            statistics.stdev(column), rel=1e-9
        )
    differing = [
        c.what
        for c in (
            claim(identification, f"{m} of {n}")
            for m in ("mean", "standard deviation")
            for n in ("b0", "b1", "a", "R1", "R2", "C")
        )
        if not c.holds
    ]
    assert differing == ["standard deviation of C"]


def test_row_22_the_deviation_of_c_is_that_of_the_rounded_entries():
    printed, consistent = 0.344, statistics.stdev(bilinear(*theta)[2] for theta, _ in TABLE)
    assert statistics.stdev(entries[2] for _, entries in TABLE) == pytest.approx(printed, abs=5e-4)
    assert f"{consistent:.3f} F from the listed coefficients" in row(identification, 22).holds
    # no rounding of the coefficients makes up for it
    rng = np.random.default_rng(22)
    theta = np.array([t for t, _ in TABLE])
    drawn = [
        np.std([bilinear(*t)[2] for t in theta + rng.uniform(-5e-5, 5e-5, theta.shape)], ddof=1)
        for _ in range(500)
    ]
    assert max(drawn) < printed - 5e-4


def test_row_21_table_3_1_was_sampled_at_10_hz():
    (theta, entries), printed = TABLE[0], 30.0
    agree = []
    for frequency in (printed, 10.0):
        discrete = control.sample_system(impedance(*entries), 1 / frequency, "tustin")
        b0, b1, a = *discrete.num[0][0], discrete.den[0][0][1]
        agree.append(np.allclose((b0, b1, a), theta, atol=2e-3))
    assert agree == [False, True]
    assert claims(identification, 21)[0].reproduced == pytest.approx(10.0, rel=0.01)
    assert "at 10.0 Hz only" in row(identification, 21).holds


def test_row_23_a_is_the_pole():
    b0, b1, a = TABLE[0][0]
    discrete = control.tf([b0, b1], [1.0, a], 0.1)
    assert control.poles(discrete).real == pytest.approx([-a])
    assert control.zeros(discrete).real == pytest.approx([-b1 / b0])
    assert (
        f"{control.poles(discrete)[0].real:.4f} and {control.zeros(discrete)[0].real:.4f}"
        in row(identification, 23).holds
    )
    assert [(c.published, c.reproduced) for c in claims(identification, 23)] == [("zero", "pole")]


def test_row_24_the_first_program_of_a2_has_its_pairs_exchanged():
    s = control.tf("s")
    k2, b2, k1, b1 = 3190.0, 0.76, 1.0, 0.02
    program = (b1 * b2 * s**2 + (k2 * b2 + k1 * b2 + k2 * b1) * s + k1 * k2) / (
        b1 * b2 * k2 * s**2 + k1 * k2 * b2 * s
    )

    def equation_3_7(k1, b1, k2, b2):
        return (b2 / k1 * s**2 + (1 + k2 / k1 + b2 / b1) * s + k2 / b1) / (s * (k2 + b2 * s))

    at = 1j * np.logspace(-1, 3, 9)
    assert program(at) == pytest.approx(equation_3_7(k2, b2, k1, b1)(at), rel=1e-9)
    assert not np.allclose(program(at), equation_3_7(k1, b1, k2, b2)(at), rtol=0.5)
    assert [(c.published, c.reproduced) for c in claims(actuator, 24)] == [("2", "1")]


def test_row_25_the_state_of_tf2ss_is_no_voltage():
    _, _, c, _ = tf2ss([R1 * R2 * C, R2], [(R1 + R2) * C, 1.0])
    assert claims(actuator, 25)[0].reproduced == pytest.approx(float(c[0, 0]), rel=1e-9)
    assert f"{c[0, 0]:.3f} of it shows in the output" in row(actuator, 25).holds


def test_row_26_other_models_beat_the_one_called_best():
    # fit on identification data, on validation data, AIC; table 3-2, typed in again
    arx, armax, oe, ss, bj = (
        (86.8, 80.1, -9.5),
        (75.0, 58.7, -9.2),
        (95.8, 92.9, -7.6),
        (92.8, 86.4, -9.7),
        (94.3, 90.1, -9.5),
    )
    assert oe[0] == max(m[0] for m in (arx, armax, oe, ss, bj)) > bj[0]
    assert oe[1] == max(m[1] for m in (arx, armax, oe, ss, bj)) > bj[1]
    assert ss[2] == min(m[2] for m in (arx, armax, oe, ss, bj)) < bj[2] == arx[2]
    assert [c.reproduced for c in claims(identification, 26)] == ["OE", "OE", "SS"]
    assert "−9.7 against −9.5, which ARX has too" in row(identification, 26).holds


def test_row_20_noise_of_an_arx_model_is_coloured_to_the_order_of_the_model():
    """Noise through 1/A is no white noise, and by Yule-Walker it takes three past values to predict
    it.
    """
    a = [1.0, -1.1, 0.03, 0.135]
    noise = lfilter([1.0], a, np.random.default_rng(20).standard_normal(200_000))
    lags = np.array([noise[: noise.size - k] @ noise[k:] for k in range(5)]) / noise.size
    predictor = np.linalg.solve(toeplitz(lags[:4]), lags[1:5])
    assert predictor[:3] == pytest.approx([1.1, -0.03, -0.135], abs=0.02)
    assert predictor[3] == pytest.approx(0.0, abs=0.02)
    assert identification.noise_order([1.0], a) == 3 == claims(identification, 20)[0].reproduced
    assert identification.noise_order(a, a) == 0  # as for OE
    assert "86.8 and 75 %" in row(identification, 20).holds


def test_row_45_armax_contains_arx():
    """On an ARX record: a free C never makes the loss larger, so that AIC grows by 2 nc / N at
    most.
    """
    noise = np.random.default_rng(45).standard_normal(1000)
    u = np.sign(np.sin(0.1 * np.arange(1000)))
    y = lfilter([1.0], [1.0, -0.9], noise) + lfilter([0.0, 0.5], [1.0, -0.9], u)
    rows = np.column_stack([-y[:-1], u[:-1]])

    def loss(theta):
        return float(np.mean(lfilter([1.0], [1.0, theta[2]], y[1:] - rows @ theta[:2]) ** 2))

    arx = np.linalg.lstsq(rows, y[1:])[0]
    armax = minimize(loss, [*arx, 0.0], method="Nelder-Mead").x
    assert loss(armax) <= loss([*arx, 0.0])
    (found,) = claims(identification, 45)
    assert found.reproduced == pytest.approx(-9.5 + 2 * 3 / 1000)
    assert found.reproduced < -9.25  # all that rounds to -9.2 is above
    assert "at most −9.49 with 1000 samples" in row(identification, 45).holds


def test_row_30_alpha_is_another_by_a_factor():
    # fastest strain: all of 1.3 A beside the leakage charges the films
    rate = 100 * 0.068e-3 * 1.3 * R2 / (R1 + R2) / 93.2e-3
    ratio = claim(actuator, "how often 5 mm/C holds the alpha of fig. 3-10")
    assert ratio.reproduced == pytest.approx(5 / 0.068, rel=1e-9)
    assert not ratio.holds
    assert claim(actuator, "strain rate of the 12-layer actuator").reproduced == pytest.approx(
        rate, rel=1e-9
    )
    assert "it is 74 times the 0.068 mm/C" in row(actuator, 30).holds
    assert claim(actuator, "strain rate of PPy", "table 1-1").reproduced == pytest.approx(
        rate, rel=1e-9
    )
    assert f"{rate:.2f} %/s at most" in row(actuator, 30).holds
    assert f"{0.5 / rate:.0f} to {1.0 / rate:.0f} times" in row(actuator, 30).holds


def test_row_8_held_current_by_control():
    discrete = control.sample_system(impedance(), 0.1, "zoh")
    theta = (*discrete.num[0][0], discrete.den[0][0][1])
    assert circuit.held_coefficients(R1, R2, C, 0.1) == pytest.approx(theta, rel=1e-9)
    found = bilinear(*theta)
    assert [c.reproduced for c in claims(identification, 8)] == pytest.approx(found, rel=1e-9)
    assert " Ω, ".join(f"{x:.3f}" for x in found[:2]) in row(identification, 8).holds
    assert [round(x, 3) for x in found] == [0.412, 2.350, 2.718]


def test_square_wave_that_has_lasted():
    """Against a solver that goes through forty half periods."""
    charge = 0.0
    for k in range(40):
        current = 1.3 if k % 2 == 0 else -1.3
        charge = solve_ivp(
            lambda t, q, i=current: (R2 * i - q / C) / (R1 + R2),
            (0, 5),
            [charge],
            rtol=1e-10,
            atol=1e-12,
        ).y[0, -1]
    voltage = abs(R1 * (R2 * -1.3 - charge / C) / (R1 + R2) + charge / C)
    assert circuit.periodic_voltage(R1, R2, C) == pytest.approx(voltage, rel=1e-6)


def test_what_stays_after_the_loads_is_what_the_dashpot_took():
    time, force = actuator.staircase()
    assert (force.min(), force.max(), time[-1]) == (0.5, 2.75, 600.0)
    impulse = sum(0.25 * (k + 1) * 30.0 for k in range(9))  # above the bias, N s
    stays = claim(actuator, "elongation that stays when all is unloaded")
    assert stays.reproduced == pytest.approx(1e3 * impulse / 1.7e6, rel=1e-6)
    assert stays.holds


def test_equations_3_6_to_3_9_follow_from_3_5():
    assert [
        c.holds
        for c in (
            claim(actuator, f"{name}")
            for name in (
                "electrochemical displacement from current",
                "mechanical displacement from force",
                "voltage from current",
            )
        )
    ] == [True] * 3
    time = np.linspace(0.0, 20.0, 201)
    current = np.where(time < 10.0, 0.9, -0.4)
    found = actuator.run(time, {"current": current})
    exact = control.forced_response(
        control.sample_system(control.ss(impedance()), 0.1, "zoh"), time, current
    ).outputs
    assert found["voltage"] == pytest.approx(exact, rel=1e-7, abs=1e-9)


def test_table_1_1_is_beside_what_the_model_does():
    """1.3 A for ever leave R2 C i on the films, and begin with R2 / (R1 + R2) of it a second."""
    charge = 1.3 * 2.35 * 2.7
    assert claim(actuator, "strain of PPy").reproduced == pytest.approx(100 * 0.068 * charge / 93.2)
    assert claim(actuator, "strain of PPy").erratum == 30
    assert actuator.MATERIALS["shape memory alloy"].strain == (5.0, 5.0)
