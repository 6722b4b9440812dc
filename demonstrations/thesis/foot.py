"""Chapter 5, the foot: eq. 5.1, table 5-1, eqs. 5.3 to 5.12, and the units of the symbol list."""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees, log10

import numpy as np

from demonstrations.thesis import motor, stance
from demonstrations.thesis.claim import Claim, Entry, Erratum, Illustration, number
from demonstrations.thesis.motor import DcMotor, Maxwell
from demonstrations.thesis.printed_foot import MILLIMETRES_PER_INCH, printed
from demonstrations.thesis.work_loops import DAMPING, STIFFNESS
from fmus.foot import Foot
from fmus.kit.arrays import Array

_TEST = "demonstrations/thesis/test_foot"
# table 5-1 as printed, with the same number in appendix A4: inches, degrees
TABLE = {
    "l_1": ("50.8", 2.00),
    "l_2": ("62.5", 2.46),
    "l_3": ("23.6", 0.93),
    "l_po,0": ("93.2", 3.67),
    "l_an,0": ("97.5", 3.84),
    "l_do,0": ("113.3", 4.46),
    "l_pl,0": ("139.2", 5.48),
    "r_po": ("41.7", 1.64),
    "r_an": ("18.0", 0.71),
    "r_do": ("23.1", 0.91),
    "r_pl": ("16.3", 0.64),
    "beta_pf": ("49.0", 49.03),
    "beta_df": ("30.9", 30.896),
    "beta_p": ("10.1", 10.075),
    "beta_po": ("57.7", 57.66),
    "beta_an": ("50.7", 50.71),
    "gamma_po": ("12.9", 12.901),
    "gamma_an": ("6.1", 6.126),
    "gamma_do": ("15.1", 15.064),
}


def entries() -> Iterator[Entry]:
    """Yield claims and errata of chapter 5 and the list of symbols."""
    for part in (_motor, _table, _matrices, _shape_of_matrices, _statics, _symbols):
        yield from part()


# --- eq. 5.1
# --------------------------------------------------------------------------------------------------


def _motor() -> Iterator[Entry]:
    import control

    driven = DcMotor()
    muscle = Maxwell()
    integrators = int(np.sum(np.abs(control.poles(driven.transfer_function())) < 1e-9))
    yield Claim("eq. 5.1", "free integrators of the motor", "1", float(integrators), inferred=True)
    lasting = float(abs(muscle.stiffness(0.0)))
    yield Claim(
        "section 5.1 against eq. 5.17",
        "stiffness of PPy under a lasting load",
        ">0",
        lasting,
        "N/m",
        "s k b/(b s + k) vanishes at rest, and eq. 3.7 has the pole s = 0: by the reading of"
        " section 5.1 PPy has none either",
        erratum=34,
        inferred=True,
    )
    load = 2.75  # N
    volts, watts = driven.holding(load)
    yield Erratum(
        34,
        "section 5.1",
        "the free integrator of eq. 5.1 can be read as a lack of stiffness; PPy inherently has"
        " stiffness",
        "by that reading PPy has none either: eqs. 3.7 and 5.17 have a free integrator too, their"
        f" stiffness under a lasting load is {lasting:g} N/m. What differs is the time: PPy is a"
        f" spring for b/k = {muscle.time_constant:.0f} s; a small shorted motor (assumed) yields"
        f" after {1e3 * driven.time_constant:.0f} ms and needs {volts:.1f} V and {watts:.2f} W to"
        f" hold {load:g} N",
        "demonstrations/thesis/test_motor",
    )


# --- table 5-1
# --------------------------------------------------------------------------------------------------


def _table() -> Iterator[Entry]:
    for symbol, (text, program) in TABLE.items():
        length = symbol[0] in "lr"
        value = program * MILLIMETRES_PER_INCH if length else program
        yield Claim(
            "table 5-1",
            symbol,
            text,
            value,
            "mm" if length else "deg",
            "appendix A4" + ", in inches" * length,
        )
    total = sum(TABLE[symbol][1] for symbol in ("beta_pf", "beta_df", "beta_p"))
    yield Claim(
        "eq. 5.3",
        "beta_pf + beta_df + beta_p",
        "90.0",
        total,
        "deg",
        "so that its third link has cosines",
        inferred=True,
    )


# --- eqs. 5.11 and 5.12
# -----------------------------------------------------------------------------------------------


def consistent() -> tuple[Array, Array]:
    """Return compliance (mm/N) and damping (N s/mm) at the toe in the reference configuration.

    Antagonistic actuators are in parallel.
    """
    foot = Foot()
    pairs = ((0, 0), (0, 1), (1, 0), (1, 1))
    compliance = np.reshape([foot.compliance(*p) for p in pairs], (2, 2)) * 1e3
    return compliance, np.reshape([foot.damping(*p) for p in pairs], (2, 2)) * 1e-3


def _matrices() -> Iterator[Entry]:
    program = printed()
    compliance, damping = consistent()
    for equation, name, unit, texts, values, right in (
        ("eq. 5.11", "C", "mm/N", ("1081", "9.6", "7.3"), program.compliance, compliance),
        ("eq. 5.12", "D", "N*s/mm", ("1.7e7", "1.5e5", "1.1e5"), program.damping, damping),
    ):
        for (row, column), axes, text in zip(
            ((0, 0), (0, 1), (1, 1)), ("xx", "xy", "yy"), texts, strict=True
        ):
            yield Claim(
                equation,
                f"{name}_{axes}",
                text,
                float(values[row, column]),
                unit,
                "follows from the printed program in inches only",
                f"{number(right[row, column])} {unit}",
                12,
            )
    c = program.compliance
    d = program.damping
    in_mm = printed(MILLIMETRES_PER_INCH).compliance[0, 0]
    foot_length = sum(TABLE[symbol][1] for symbol in ("l_1", "l_2", "l_3")) * MILLIMETRES_PER_INCH
    yield Erratum(
        12,
        "eqs. 5.11, 5.12",
        "C_x = [[1081, 9.6], [9.6, 7.3]] mm/N, D_x = [[1.7e7, 1.5e5], [1.5e5, 1.1e5]] N·s/mm",
        f"the printed program in inches gives {_matrix(c, '.2f', '.3f')} and"
        f" {_matrix(d, '.3e', '.3e')}. They rest on its constant 1e-4, not on the foot: in mm the"
        f" same program has C_xx = {_short(in_mm, '.1e')}; 1 N would move the toe of a"
        f" {foot_length:.0f} mm foot by {c[0, 0]:.0f} mm. Consistent:"
        f" {_matrix(compliance, '.2f', '.2f')} and {_matrix(damping, '.0f', '.0f')}",
        "demonstrations/thesis/test_printed_foot",
    )
    for name, matrix, right in (("C", c, compliance), ("D", d, damping)):
        yield Claim(
            "text under eq. 5.12",
            f"{name}_xx over {name}_yy, two orders of magnitude",
            "~1e2",
            matrix[0, 0] / matrix[1, 1],
            "",
            "of the printed matrix",
            number(right[0, 0] / right[1, 1]),
            12,
        )


def _shape_of_matrices() -> Iterator[Entry]:
    """Yield claims about relations between the printed matrices, and between them and lengths."""
    c = printed().compliance
    d = printed().damping
    damping = consistent()[1]
    larger = "y" if d[1, 1] > d[0, 0] else "x"
    yield Claim(
        "text under eq. 5.12",
        "direction of the larger damping",
        "y",
        larger,
        reason="the text expects y, the printed matrix says x",
        erratum=37,
        consistent=f"D_yy = {damping[1, 1] / damping[0, 0]:.1f} D_xx",
    )
    yield Erratum(
        37,
        "text under eq. 5.12",
        "the damping is expected to be larger along y, just after it is larger along x",
        f"the printed matrix has it {d[0, 0] / d[1, 1]:.0f} times larger along x; with antagonists"
        f" in parallel it is {damping[1, 1] / damping[0, 0]:.1f} times larger along y, as the text"
        " expects",
        _TEST,
    )
    product = STIFFNESS * DAMPING
    share = float(np.ptp(d / c / product))
    yield Claim(
        "eqs. 5.7 and 5.9",
        "D_x, but for the factor k b",
        "a matrix of its own",
        "C_x" if share < 1e-9 else "a matrix of its own",
        reason="damping is mapped as compliance is, so that both are one matrix",
        erratum=36,
        inferred=True,
    )
    yield Erratum(
        36,
        "eqs. 5.11, 5.12",
        "two matrices, compliance and damping",
        f"one: D_x = k b C_x with k b = {product:g} N²·s/mm², because eq. 5.9 maps damping as if it"
        " were compliance",
        _TEST,
    )
    power = round(
        log10(printed(MILLIMETRES_PER_INCH, 1e-4 * MILLIMETRES_PER_INCH).compliance[0, 0] / c[0, 0])
        / log10(MILLIMETRES_PER_INCH),
        1,
    )
    yield Claim(
        "appendix A4, J(3,4)",
        "power of length in C_xx",
        "0",
        float(power),
        reason="r_pl multiplies where the other entries divide by the radius",
        erratum=35,
        inferred=True,
    )
    yield Erratum(
        35,
        "appendix A4, `J(3,4)`",
        "`L(4)*rpl/sqrt(L(4)^2-lopl^2)`",
        "the radius belongs into the denominator, as in the other entries of J: as printed it is a"
        " length where they are inverse lengths, so that C_xx grows with length to the power"
        f" {power:.0f} when all lengths grow alike",
        _TEST,
    )


def _short(value: float, form: str) -> str:
    return f"{value:{form}}".replace("e+0", "e").replace("e+", "e").replace("-", "−")


def _matrix(values: Array, first: str, others: str) -> str:
    a, b, c, d = (_short(v, others if n else first) for n, v in enumerate(values.flat))
    return f"[[{a}, {b}], [{c}, {d}]]"


def _statics() -> Iterator[Entry]:
    foot = Foot()
    ankle, _, toe = foot.joint_stiffnesses()
    arms = [abs(arm) * 1e3 for arm in foot.arms()]
    k = foot.k_an
    series = 1.0 / sum(
        1.0 / (k * (arm * 1e-3) ** 2) for arm in arms[:2]
    )  # compliances added, as eq. 5.7 does
    yield Claim(
        "eq. 5.7",
        "stiffness of the ankle",
        f"{series:.2f}",
        ankle,
        "N*m/rad",
        "eq. 5.7 adds compliances of the antagonists; parallel springs add stiffness",
        erratum=13,
        inferred=True,
    )
    yield Erratum(
        13,
        "eqs. 5.3, 5.7, 5.9",
        "the program has sin where eq. 5.3 has cos, and two of its signs turned; compliances of"
        " antagonists add",
        "antagonists on one joint act in parallel: stiffness and damping add, K_θ = Rᵀ K_ℓ R. With"
        f" moment arms of {arms[0]:.1f}, {arms[1]:.1f}, {arms[2]:.1f} and {arms[3]:.1f} mm the"
        f" ankle has {ankle:.2f} N·m/rad and the toe {toe:.2f} N·m/rad; adding compliances leaves"
        f" {series:.2f} N·m/rad at the ankle. The plantar arm is a choice, for its triangle is"
        " singular in the reference configuration. The program couples do and pl to the arch by a"
        " token 0.001",
        "components/foot/test_kinematics",
    )


# --- symbol list
# --------------------------------------------------------------------------------------------------


def _symbols() -> Iterator[Entry]:
    yield Erratum(
        16,
        "symbol list",
        "compliance c_i in N/mm",
        "mm/N, as c_i = 1/k_i (symbol list) and in eq. 5.11",
    )
    yield Erratum(
        17,
        "symbol list",
        "one K for coil and motor, in N·m/A or V·s; joint displacements δθ in deg",
        "those are the motor's units; the coil's are N/A or V·s/m. δθ in rad: eq. 5.2 gives mm per"
        f" rad, and with degrees it would be {degrees(1.0):.1f} times too large",
        _TEST,
    )


# --- figures
# --------------------------------------------------------------------------------------------------


def illustrations() -> tuple[Illustration, ...]:
    """Return figures of the motor of eq. 5.1 beside the actuator, and of the stance phase."""
    return (
        Illustration(
            "Eq. 5.1: a motor and a muscle under one load",
            "What remains of the stiffness after a load has been on for a time, and how far it has"
            " moved. Both yield under a lasting load. The actuator is a spring for minutes before"
            " its dashpot shows; a motor with shorted armature is one for no time at all, only its"
            " rotor's inertia delays it. The motor is a small brushed one on a spool, assumed, for"
            " the thesis gives no numbers.",
            motor.figure,
        ),
        Illustration(
            "Fig. 5-8: the stance phase, prescribed and on a ground",
            "Left: the lengths of eqs. 5.13 to 5.16, and a reaction that is given (fig. 5-8 has no"
            " numbers). Right: a foot under a leg of 31 g, a tenth in mass, in a stance eight times"
            " as slow, on a ground that makes its reaction. The body lets it down on its heel;"
            " currents of 1.3 A roll the weight to the ball, as the phases of eqs. 5.13 to 5.16 ask"
            " for, and the body lifts it. Actuators move by 0.2 mm at most where the equations have"
            " millimetres: that is what the charge of 1.3 A makes of films of 0.068 mm/C."
            " `ppy run foot_stance` gives the figures.",
            stance.figure,
        ),
    )
