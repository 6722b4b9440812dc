"""Chapter 3, identification: tables 3-1 and 3-2, sampling, conversion of discrete parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from demonstrations.graphical import tustin
from demonstrations.thesis.circuit import CIRCUIT, PERIOD, held_coefficients
from demonstrations.thesis.claim import Claim, Entry, Erratum, Illustration, spread

# table 3-1 as printed: b0, b1, a, then R1, R2, C of the three data sets, and their means and
# standard deviations
SETS = (
    ("0.3970", "-0.3632", "-0.9869", "0.45", "2.58", "2.50"),
    ("0.3648", "-0.3321", "-0.9839", "0.43", "2.02", "2.51"),
    ("0.3706", "-0.3430", "-0.9887", "0.42", "2.45", "3.1"),
)
MEANS = ("0.377", "-0.346", "-0.987", "0.43", "2.35", "2.70")
DEVIATIONS = ("0.017", "0.016", "0.002", "0.015", "0.293", "0.344")
COLUMNS = (("b0", ""), ("b1", ""), ("a", ""), ("R1", "ohm"), ("R2", "ohm"), ("C", "F"))
# table 3-2 as printed: fit on identification and on validation data in percent, and Akaike's
# criterion
BLACK_BOX = {
    "ARX": (86.8, 80.1, -9.5),
    "ARMAX": (75.0, 58.7, -9.2),
    "OE": (95.8, 92.9, -7.6),
    "SS": (92.8, 86.4, -9.7),
    "BJ": (94.3, 90.1, -9.5),
}


def entries() -> Iterator[Entry]:
    """Yield claims and errata about the identified parameters."""
    for part in (_table_3_1, _sampling, _conversion, _table_3_2):
        yield from part()


def illustrations() -> tuple[Illustration, ...]:
    """Return an empty tuple, as the measured figures are lost."""
    return ()


# --- table 3-1
# --------------------------------------------------------------------------------------------------


def _circuit(part: int, *theta: float) -> float:
    """Return R1, R2 or C from b0, b1 and a by eqs. 3.11 to 3.13."""
    return float(tustin(theta, PERIOD)[part])


def _moment(column: int, name: str, *theta: float) -> float:
    """Return the mean or standard deviation of a column of table 3-1.

    The arguments are the coefficients of all data sets in a row.
    """
    table = np.reshape(theta, (len(SETS), 3))
    values = np.hstack([table, tustin(table, PERIOD)])[:, column]
    return float(np.mean(values) if name == "mean" else np.std(values, ddof=1))


def _table_3_1() -> Iterator[Entry]:
    differing = []
    for n, row in enumerate(SETS, 1):
        for part, (name, unit) in enumerate(COLUMNS[3:]):
            law = partial(_circuit, part)
            entry = Claim(
                f"table 3-1, set {n}",
                name,
                row[3 + part],
                law(*map(float, row[:3])),
                unit,
                "eqs. 3.11 to 3.13 on the printed coefficients",
                allowed=spread(law, row[:3]),
            )
            if not entry.agrees:
                entry = replace(entry, erratum=10)
                differing.append(entry)
            yield entry
    r1, r2, third = differing
    low, high = r2.allowed or (0.0, 0.0)
    yield Erratum(
        10,
        "table 3-1",
        f"set 2: R1 = {r1.published}, R2 = {r2.published}; set 3: R2 = {third.published} (Ω)",
        f"the listed b0, b1, a give {r1.reproduced:.4g}, {r2.reproduced:.4g} and"
        f" {third.reproduced:.4g} Ω by eqs. 3.11–3.13 (Ts = {PERIOD:g} s); rounding of the listed"
        f" coefficients can account for all three: it leaves R2 of set 2 between {low:.3f} and"
        f" {high:.3f} Ω",
    )
    coefficients = [text for row in SETS for text in row[:3]]
    for column, (name, unit) in enumerate(COLUMNS):
        for moment, printed in (
            ("mean", MEANS[column]),
            ("standard deviation", DEVIATIONS[column]),
        ):
            law = partial(_moment, column, moment)
            value = law(*map(float, coefficients))
            wrong = (moment, name) == ("standard deviation", "C")
            yield Claim(
                "table 3-1",
                f"{moment} of {name}",
                printed,
                value,
                unit,
                "it is that of the rounded entries" * wrong,
                erratum=22 if wrong else None,
                allowed=spread(law, coefficients),
            )
            if wrong:
                rounded = float(np.std([float(row[column]) for row in SETS], ddof=1))
                yield Erratum(
                    22,
                    "table 3-1",
                    f"standard deviation of C: {printed} F",
                    f"{value:.3f} F from the listed coefficients; {rounded:.3f} F is that of the"
                    " rounded entries",
                    "demonstrations/thesis/test_actuator",
                )
    variance = max(float(text) ** 2 for text in DEVIATIONS[:3])
    yield Claim(
        "section 3.3.1", "largest variance of b0, b1 and a", "<0.03", variance, "", "over the sets"
    )
    tau = (CIRCUIT[0] + CIRCUIT[1]) * CIRCUIT[2]
    yield Claim("section 3.3.1", "charging time constant", "7.5", tau, "s", "(R1 + R2) C")


def _sampling() -> Iterator[Entry]:
    b0, b1, a = map(float, SETS[0][:3])
    # eq. 3.10: (b0 z + b1)/(z + a)
    (pole,) = np.roots([1.0, a])
    (zero,) = np.roots([b0, b1])

    def rate(b0: float, b1: float, a: float, c: float) -> float:
        return (b1 - a * b0) / (c * (b0 + b1) ** 2)  # eq. 3.13

    known = Claim(
        "section 2.2.2",
        "sampling frequency of table 3-1",
        "30",
        rate(b0, b1, a, float(SETS[0][5])),
        "Hz",
        "eq. 3.13 gives C only with 0.1 s",
        erratum=21,
        allowed=spread(rate, [*SETS[0][:3], SETS[0][5]]),
    )
    yield known
    yield Erratum(
        21,
        "section 2.2.2",
        f"all data were sampled at {known.published} Hz",
        f"C of table 3-1 follows from its coefficients at {known.reproduced:.1f} Hz only; the"
        " programs read records of 100 and 50 Hz (A2), 10 Hz (A3) and 40 Hz (A4), section 4.3 says"
        " 15 Hz",
        "demonstrations/thesis/test_actuator",
    )
    yield Claim(
        "symbol list",
        "what a fixes in eq. 3.10",
        "zero",
        "pole" if np.isclose(-a, pole) else "zero",
        reason="the denominator 1 + a/z vanishes at -a; b0 and b1 fix the zero",
        erratum=23,
    )
    yield Erratum(
        23,
        "symbol list; sections 3.1.4, 4.1.1",
        "b0, b1: pole parameters; a: zero parameter; the text estimates a, b1 and b2",
        f"eq. 3.10 has its pole at −a and its zero at −b1/b0, {pole:.4f} and {zero:.4f} in set 1;"
        " it has no b2",
        "demonstrations/thesis/test_actuator",
    )


def _conversion() -> Iterator[Entry]:
    r1, r2, c = CIRCUIT
    converted = tustin(held_coefficients(r1, r2, c, PERIOD), PERIOD)
    for (name, unit), printed, value in zip(COLUMNS[3:], MEANS[3:], converted, strict=True):
        yield Claim(
            "eqs. 3.11 to 3.13",
            f"{name} of table 3-1 from held current",
            printed,
            float(value),
            unit,
            "Tustin's rule takes the current for a ramp; the galvanostat holds it",
            erratum=8,
            inferred=True,
        )
    yield Erratum(
        8,
        "eqs. 3.11–3.13",
        "Tustin's rule converts the parameters of eq. 3.10",
        f"exact for Tustin-generated data only: of R1 {r1:g} Ω, R2 {r2:g} Ω, C {c:g} F with a"
        f" current held for {PERIOD:g} s it makes {converted[0]:.3f} Ω, {converted[1]:.3f} Ω and"
        f" {converted[2]:.3f} F",
        "demonstrations/graphical/test_impedance",
    )


def _table_3_2() -> Iterator[Entry]:
    fit, validation, akaike = (
        dict(zip(BLACK_BOX, column, strict=True))
        for column in zip(*BLACK_BOX.values(), strict=True)
    )
    best = (
        max(fit, key=fit.__getitem__),
        max(validation, key=validation.__getitem__),
        min(akaike, key=akaike.__getitem__),
    )
    printed = "BJ"
    about = "largest fit and smallest criterion in the table itself"
    for what, model in zip(
        ("identification data", "validation data", "Akaike's criterion"), best, strict=True
    ):
        yield Claim("table 3-2", f"best model by {what}", printed, model, reason=about, erratum=26)
    as_good = [model for model in akaike if akaike[model] == akaike[printed] and model != printed]
    yield Erratum(
        26,
        "table 3-2; section 6.1.1",
        "the Box-Jenkins model performs best overall; it minimises Akaike's criterion",
        f"in no column of the table: {best[0]} fits better, {fit[best[0]]:g} and"
        f" {validation[best[0]]:g} % against {fit[printed]:g} and {validation[printed]:g} %, and"
        f" {best[2]} has the smaller criterion, {akaike[best[2]]:g} against {akaike[printed]:g},"
        f" which {' and '.join(as_good)} has too. It can be meant as a balance of the three, and as"
        " the least within its own type".replace("-", "−"),
        "demonstrations/thesis/test_actuator",
    )
    order = noise_order([1.0], [1.0, -1.1, 0.03, 0.135])
    yield Claim(
        "table 3-2",
        "order of the noise model of ARX",
        "0",
        float(order),
        reason=(
            "noise passes 1/A, of the order of the model; if C is meant, ARMAX with C = 1 would"
            " be ARX"
        ),
        erratum=20,
    )
    yield Erratum(
        20,
        "table 3-2",
        "noise model order 0 for ARX and ARMAX",
        "neither reading fits. The noise model is 1/A in the one and C/A in the other, of order"
        f" {order} like the model; 0 then holds for OE only. If the order of C alone is meant,"
        f" ARMAX with C = 1 is ARX, yet the table has {fit['ARX']:g} and {fit['ARMAX']:g} % for"
        " them",
        "demonstrations/thesis/test_actuator",
    )

    yield from _compare_armax(akaike)


def _compare_armax(akaike: Mapping[str, float]) -> Iterator[Entry]:
    """Yield claims about ARMAX and ARX: as ARX is ARMAX with C = 1, its loss is not smaller."""
    coefficients = 3
    samples = 1000
    most = akaike["ARX"] + 2.0 * coefficients / samples
    yield Claim(
        "table 3-2",
        "largest criterion of ARMAX beside that of ARX",
        f"{akaike['ARMAX']:g}",
        most,
        "",
        f"ARMAX contains ARX of the same orders; {coefficients} coefficients of C cost "
        f"{2.0 * coefficients / samples:g} with {samples} samples, and less with more",
        erratum=45,
        inferred=True,
    )
    yield Erratum(
        45,
        "table 3-2",
        f"Akaike's criterion: {akaike['ARX']:g} for ARX, {akaike['ARMAX']:g} for ARMAX of the same"
        " orders",
        f"with C = 1 ARMAX is ARX. At its optimum its criterion is at most {most:.2f} with"
        f" {samples} samples or more, so that the figures of ARMAX are those of a search that ended"
        " before; on records like those of fig. 3-12 it is never behind ARX by the criterion"
        " (`docs/black-box-structures.md`)".replace("-9", "−9"),
        "demonstrations/thesis/test_actuator",
    )


def noise_order(c: Sequence[float], a: Sequence[float]) -> int:
    """Return the order of the noise model C/A without common factors.

    Parameters
    ----------
    c, a : sequence of float
        Coefficients of ascending powers of the delay.
    """
    import control

    size = max(len(c), len(a))
    padded = [np.pad(np.asarray(p, dtype=float), (0, size - len(p))) for p in (c, a)]
    return len(control.poles(control.minreal(control.tf(*padded, 1.0), verbose=False)))
