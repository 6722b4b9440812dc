"""The published figure and the consistent one, side by side: one test for each row of
docs/errata.md.

Rows whose test is elsewhere name it; figures here come from other computations than those that
write the page.
"""

import re
from pathlib import Path

import control
import numpy as np
import pytest
from scipy.signal import butter, freqs

from demonstrations.emulator.emulator import EmulatedRig
from demonstrations.emulator.physics import RigParameters
from demonstrations.thesis import (
    analyser,
    chapters,
    circuit,
    degradation,
    foot,
    force_loop,
    forgetting,
    identification,
)
from fmus import component
from fmus.kit.units import parse
from orchestration.experiment.waveforms import square_wave
from orchestration.identify.grey_box import fit_grey_box
from tests.support.thesis_findings import claim, claims, row

DEFAULT = {p.name: p.start for p in component("ppy_actuator").layout.parameters}
ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "errata.md").read_text(encoding="utf-8")
NUMBERS = [int(number) for number in re.findall(r"^\| (\d+) \|", PAGE, re.M)]

# --- the page
# --------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_page_is_what_the_computations_give() -> None:
    assert chapters.errata_page() == PAGE, "run python -m demonstrations.thesis.chapters"


@pytest.mark.slow
def test_rows_are_numbered_without_gaps() -> None:
    rows = chapters.errata()
    assert NUMBERS == [e.number for e in rows] == list(range(1, len(rows) + 1))
    for e in rows:
        assert "|" not in e.where + e.printed + e.holds, f"row {e.number} breaks the table"
        assert all((e.where, e.printed, e.holds))


@pytest.mark.slow
@pytest.mark.parametrize("number", NUMBERS)
def test_the_cited_file_tests_the_row(number) -> None:
    erratum = chapters.errata()[number - 1]
    text = (ROOT / "tests" / f"{erratum.test}.py").read_text(encoding="utf-8")
    assert re.search(rf"(row|errata)[ _]{number}(?!\d)", text, re.I), (
        f"nothing in {erratum.test}.py"
    )


@pytest.mark.slow
def test_claims_that_do_not_hold_give_a_reason_and_a_row_that_exists() -> None:
    every = [c for group in chapters.claims().values() for c in group]
    numbers = set(NUMBERS)
    for c in every:
        assert c.holds or c.reason, f"{c.where}, {c.what}: no reason"
        assert c.erratum is None or c.erratum in numbers
    for number in numbers - {15, 16, 17}:  # 15 is a rounding, 16 and 17 are units: reasoning alone
        of_row = [c.verdict for c in every if c.erratum == number]
        assert set(of_row) - {"holds"}, f"row {number}: everything holds"


# --- rows
# --------------------------------------------------------------------------------------------------

R, L, K, M, B = 3.0, 1e-3, 3.9, 0.03, 6.0  # appendix A1, typed in again
K1, K2, B2 = 3860.0, 300.0, 2300.0
T = 1.0 / 30.0


def spring(s):
    """Force per displacement of the actuator in eq. 2.1."""
    return K1 + K2 * B2 * s / (B2 * s + K2)


def coil_force(s):
    """Coil force per coil voltage, from the equations of motion."""
    mobility = s / (M * s**2 + B * s + spring(s))
    return K / (R + L * s + K**2 * mobility)


def test_row_2_the_line_of_the_program_is_not_eq_2_1() -> None:
    for frequency in (0.1, 10.0, 100.0):
        s = 2j * np.pi * frequency
        mechanical = (K1 + B * s + M * s**2) * (B2 * s + K2) + B2 * K2 * s
        line = K / (R + s * L + (K**2 * s * (B2 * s + K2))) / mechanical
        assert force_loop.program_plant(s) == pytest.approx(line, rel=1e-12)
        assert abs(line) < 1e-6 * abs(coil_force(s))
    assert float(claims(force_loop, 2)[0].published) == pytest.approx(
        abs(coil_force(2j * np.pi * 10)), abs=0.005
    )
    assert f"{abs(coil_force(2j * np.pi * 10)):.2f} N/V at 10 Hz" in row(force_loop, 2).holds


def test_row_5_what_either_filter_leaves() -> None:
    for cutoff, text in ((10.0, "the one leaves 55 %"), (100.0, "the other 99 %")):
        _, left = freqs(*butter(1, 2 * np.pi * cutoff, analog=True), worN=[2 * np.pi * 15.0])
        assert f"{100 * abs(left[0]):.0f} %" == " ".join(text.split()[-2:])
        assert text in row(analyser, 5).holds
    hum = np.cos(2 * np.pi * 60.0 * np.arange(30) / 30.0)  # sampled at 30 Hz
    assert hum == pytest.approx(np.ones(30))
    for cutoff in (10.0, 100.0):
        _, left = freqs(*butter(1, 2 * np.pi * cutoff, analog=True), worN=[2 * np.pi * 60.0])
        assert f"{100 * abs(left[0]):.0f} %" in row(analyser, 5).holds.split("folds to 0 Hz")[1]
    assert claims(analyser, 5)[0].published == "10"


def test_row_6_the_printed_denominator_needs_another_start() -> None:
    """Weighted least squares with a prior, solved at once: what either recursion must give after
    every sample.
    """
    time = 0.1 * np.arange(201)
    current = square_wave(time, 1.3, 0.1)
    voltage = circuit.response(current, np.where(time < 10, 0.43, 0.6))
    factor, covariance = 0.97, 0.5
    phi = np.column_stack([current[1:], current[:-1], -voltage[:-1]])
    for denominator, prior in ((factor, covariance), (1.0, factor * covariance)):
        found = forgetting.recursive(current, voltage, factor, denominator, covariance)
        for t in (1, 7, 60, 200):
            weights = np.sqrt(factor ** np.arange(t - 1, -1, -1.0))
            anchor = np.sqrt(factor**t / prior) * np.eye(3)
            rows = np.vstack([weights[:, None] * phi[:t], anchor])
            wanted = np.concatenate([weights * voltage[1 : t + 1], np.zeros(3)])
            assert found[t - 1] == pytest.approx(
                np.linalg.lstsq(rows, wanted)[0], rel=1e-6, abs=1e-9
            )
    assert "the printed one gives the same estimates" in row(forgetting, 6).holds
    assert (claims(forgetting, 6)[0].published, claims(forgetting, 6)[0].reproduced) == (
        "3 x 1",
        "3 x 3",
    )


def test_row_16_the_inverse_of_a_stiffness() -> None:
    stiffness = parse("N/mm")  # k_i, in the same list
    printed, holds = row(foot, 16).printed.split(" in ")[-1], row(foot, 16).holds.split(",")[0]
    assert [(parse(unit) * stiffness).dimensionless for unit in (printed, holds)] == [False, True]


def test_row_18_the_proportional_gain_is_half_the_difference() -> None:
    proportional = claim(force_loop, "proportional gain of eq. 2.2")
    by_control = control.sample_system(
        control.tf([0.36, 18.0], [1.0, 0.0]), T, "tustin"
    )  # 0.36 + 18/s
    assert by_control.num[0][0] == pytest.approx([0.66, -0.06], abs=1e-12)
    assert proportional.reproduced == pytest.approx(0.36, abs=1e-12)
    assert proportional.published == "0.66"
    assert not proportional.holds


def test_row_19_one_actuator_holds_and_the_other_flows() -> None:
    assert spring(0.0) == K1 == pytest.approx(force_loop.static_stiffness(), rel=1e-6)
    k1, b1, k2, b2 = (DEFAULT[n] for n in ("k1", "b1", "k2", "b2"))
    s = 1e-12
    assert 1 / (1 / k1 + 1 / (b1 * s) + 1 / (k2 + b2 * s)) < 1e-5 * k1
    assert "is 3860 N/m" in row(force_loop, 19).holds


def test_the_sampled_loop_reaches_its_bandwidth() -> None:
    """Eq. 2.2 carried out on the coil at a sine of the frequency found: -3 dB of the force's first
    harmonic.
    """
    frequency = float(claim(force_loop, "force bandwidth").reproduced)
    decay, corner = np.exp(-R / L * T), 2 * np.pi * 100.0
    fine = 200
    step = T / fine
    force = filtered = command = before = 0.0
    samples = []
    for k in range(600):
        error = np.cos(2 * np.pi * frequency * k * T) - filtered
        command, before = command + 0.66 * error - 0.06 * before, error
        for _ in range(fine):  # coil and filter, both exact for a held input
            filtered += (1 - np.exp(-corner * step)) * (force - filtered)
            force += (1 - np.exp(-R / L * step)) * (K / R * command - force)
            samples.append(force)
    assert decay < 1e-40
    settled = np.array(samples[200 * fine :])
    time = T * 200 + step * np.arange(1, settled.size + 1)
    periods = round(frequency * (time[-1] - time[0]))
    use = time < time[0] + periods / frequency
    harmonic = 2 * np.mean(settled[use] * np.exp(-2j * np.pi * frequency * time[use]))
    assert abs(harmonic) == pytest.approx(np.sqrt(0.5), rel=0.02)


def test_row_1_the_stiffness_of_figure_3_9_is_in_newton_per_metre() -> None:
    load, shown = 2.75, 0.4e-3  # N; m, read off figs. 3-6 to 3-8
    assert load / (DEFAULT["k1"] * 1e3) == pytest.approx(
        0.44e-6, rel=0.01
    )  # as printed: a thousandth of the plot
    assert load / DEFAULT["k1"] == pytest.approx(shown, rel=0.15)


def least_squares_r2(current: np.ndarray, voltage: np.ndarray) -> float:
    """R2 by the thesis's method: ARX (eq. 3.10) by least squares, then eq. 3.12."""
    regressor = np.column_stack([current[1:], current[:-1], -voltage[:-1]])
    b0, b1, a = np.linalg.lstsq(regressor, voltage[1:])[0]
    return float((b0 + b1) / (1 + a))


def test_row_9_noise_biases_the_printed_method_and_not_the_simulation_error() -> None:
    time = np.arange(0, 600, 0.1)
    current = square_wave(time, 0.9, 0.2)
    measured = EmulatedRig(RigParameters(), seed=3, voltage_noise=20e-3).run(
        time, current, np.zeros_like(time)
    )
    r2 = DEFAULT["R2"]
    printed = least_squares_r2(current, measured["voltage"])
    inputs = {"current": current}
    ours = fit_grey_box(
        component("ppy_actuator"), time, inputs, {"voltage": measured["voltage"]}, ["R1", "R2", "C"]
    )
    assert printed < 0.65 * r2  # 1.31 ohm for a true 2.35 ohm
    assert ours.estimates["R2"].value == pytest.approx(r2, rel=0.03)


@pytest.mark.parametrize("noise", [20e-3, 5e-3])
def test_row_9_a_long_record_comes_to_the_computed_limit(noise: float) -> None:
    time = np.arange(0, 12000, 0.1)
    current = square_wave(time, 0.9, 0.2)
    measured = EmulatedRig(RigParameters(), seed=5, voltage_noise=noise).run(
        time, current, np.zeros_like(time)
    )
    limit = float(degradation.expected_estimate(noise)[1])
    assert least_squares_r2(current, measured["voltage"]) == pytest.approx(limit, rel=0.015)
    assert f"{limit:.2f} Ω" in row(degradation, 9).holds


def test_row_10_table_3_1_follows_from_its_own_coefficients_but_for_three_entries() -> None:
    period, differing = 0.1, []  # s
    for number, (b0, b1, a, *entries) in enumerate(
        [
            (0.3970, -0.3632, -0.9869, "0.45", "2.58", "2.50"),
            (0.3648, -0.3321, -0.9839, "0.43", "2.02", "2.51"),
            (0.3706, -0.3430, -0.9887, "0.42", "2.45", "3.1"),
        ],
        1,
    ):
        r1 = -(b0 + b1) * (b0 - b1) / (2 * (a * b0 - b1))  # eq. 3.11
        r2 = (b0 + b1) / (1 + a)  # eq. 3.12
        c = -(a * b0 - b1) * period / (b0 + b1) ** 2  # eq. 3.13
        for name, value, printed in zip(("R1", "R2", "C"), (r1, r2, c), entries, strict=True):
            assert claim(
                identification, name, f"table 3-1, set {number}"
            ).reproduced == pytest.approx(value, rel=1e-9)
            if f"{value:.{len(printed) - 2}f}" != printed:
                differing.append((number, name, printed, f"{value:.4g}"))
    assert differing == [
        (2, "R1", "0.43", "0.4247"),
        (2, "R2", "2.02", "2.031"),
        (3, "R2", "2.45", "2.442"),
    ]
    assert [(c.where[-1], c.what, c.published) for c in claims(identification, 10)] == [
        (str(n), *rest) for n, *rest, _ in differing
    ]
    assert row(identification, 10).printed == "set 2: R1 = 0.43, R2 = 2.02; set 3: R2 = 2.45 (Ω)"
    assert "give 0.4247, 2.031 and 2.442 Ω" in row(identification, 10).holds


def test_row_10_rounding_of_the_coefficients_accounts_for_the_entries() -> None:
    """Coefficients drawn from all that would be printed so, converted by the bilinear rule of
    ``control``.
    """
    rng = np.random.default_rng(10)
    for number, entries in ((2, {"R1": 0.43, "R2": 2.02}), (3, {"R2": 2.45})):
        coefficients = np.array([float(text) for text in identification.SETS[number - 1][:3]])
        drawn = []
        for b0, b1, a in coefficients + rng.uniform(-5e-5, 5e-5, (400, 3)):
            r2 = (b0 + b1) / (1 + a)  # at rest, z = 1
            z = -1.0 + 1e-9  # far up in frequency only R1 and R2 are left, side by side
            both = (b0 + b1 / z) / (1 + a / z)
            r1 = both * r2 / (r2 - both)
            c = 0.1 * (1 - a) / (2 * (1 + a)) / (r1 + r2)  # pole: s = 2/T (z - 1)/(z + 1) at z = -a
            drawn.append((r1, r2, c))
        table = dict(zip(("R1", "R2", "C"), np.array(drawn).T, strict=True))
        for name, printed in entries.items():
            c = claim(identification, name, f"table 3-1, set {number}")
            low, high = c.allowed
            assert low <= table[name].min() <= table[name].max() <= high
            assert table[name].max() - table[name].min() > 0.8 * (high - low)
            assert ((table[name] > printed - 0.005) & (table[name] < printed + 0.005)).any()
            assert c.verdict == "within rounding"
