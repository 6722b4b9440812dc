"""Laws that are named where nothing is hidden, and for the emulated rig without the catalogue."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from benchmarks.tables import Table, Topic
from fmus.ppy_actuator.effects import EFFECTS
from studies.clean import Case, draw
from studies.hidden_laws import Answer, answers
from studies.judging.clean import settings_of
from studies.judging.laws_answers import GOOD, SAID, confirmed, named
from studies.judging.laws_report import words
from studies.judging.study import Row, counted, share, title

_DURATION = 300.0  # s, of a record of the rig
_FILMS = "film_voltage, capacitor_voltage"
_CHAIN = (
    "charge_elongation, creep, spring_elongation, chain_elongation, displacement,"
    " mechanical_displacement, electrochemical_displacement"
)
_CHARGE = "charge, film_voltage, capacitor_voltage, charge_elongation, electrochemical_displacement"
_FORCE = "force, load, flow_force, maxwell_rate"
_CURRENT = "current, supply_current, capacitor_current"
# by the descriptions of the emulator, and in the laws of the effects of the catalogue. Where what
# is hidden is no curve of one signal (play, a voltage that the law itself feeds), the signal that
# comes nearest is right. Of others the law and the signal of the term are right
RIG: dict[str, str] = {
    "double_layer": f"{_FILMS}, terminal_voltage + {_CURRENT} [lagged, leading]",
    "diffusion": f"{_FILMS}, terminal_voltage + {_CURRENT} [lagged, leading]",
    "nonlinear_leakage": (
        f"supply_current, capacitor_current + voltage, terminal_voltage, {_CHARGE}"
    ),
    "charge_dependent_capacitance": f"{_FILMS}, capacitance * {_CHARGE}",
    "resistance_growth": f"series_resistance, immediate_resistance * {_CURRENT} [throughput]",
    "capacitance_fade": (
        f"capacitance * {_CURRENT} [throughput]; {_FILMS} x {_CURRENT} [throughput]"
    ),
    "self_heating": f"series_resistance, immediate_resistance * {_CURRENT} [heat]",
    "force_to_voltage": f"{_FILMS} + {_FORCE}",
    "quadratic_strain": (
        f"{_CHAIN} + {_CHARGE}; charge_elongation, electrochemical_displacement x {_CHARGE}"
    ),
    "strain_saturation": (
        f"{_CHAIN} + {_CHARGE}; charge_elongation, electrochemical_displacement x {_CHARGE}"
    ),
    "strain_lag": f"{_CHAIN} + {_CHARGE} [lagged, leading]; {_CHAIN} + {_CURRENT} [lagged]",
    "strain_hysteresis": f"{_CHAIN} + {_CHARGE} [lagged, leading, ]",
    "charge_dependent_stiffness": f"spring_elongation, kelvin_force x {_CHARGE}",
    "second_kelvin": f"{_CHAIN} + {_FORCE} [lagged, leading]",
    "nonlinear_stiffness": f"{_CHAIN} + {_FORCE}; spring_elongation x {_FORCE}",
    "asymmetric_creep": "kelvin_rate, kelvin_force * kelvin_rate",
    "yield_threshold": f"flow_force, maxwell_rate * {_FORCE}",
    "slack": f"{_CHAIN} + {_FORCE}; spring_elongation x {_FORCE}",
}


def right_of(name: str) -> frozenset[Answer]:
    """Return the answers that are right of a variation of the rig, those of its term by default."""
    term = next(effect.term for effect in EFFECTS.values() if effect.id == name)
    return answers(RIG.get(name, f"{term.law} * {term.signal}"))


@dataclass(frozen=True)
class RigCase:
    """A variation of the emulated rig."""

    variation: str
    seed: int
    strength: float = 1.0

    def __str__(self) -> str:
        return f"{self.variation}, {self.strength:g}, {self.seed}"


def rig_cases(seeds: int, first: int) -> list[RigCase]:
    """Return so many records of every variation of the rig."""
    ids = dict.fromkeys(effect.id for effect in EFFECTS.values())
    return [RigCase(name, first + k) for k in range(seeds) for name in ids]


def judge_clean(case: Case) -> Row:
    """Search the laws of a clean record."""
    from studies.judging.laws import judged_answers, searched_laws

    drawn = draw(case)
    with tempfile.TemporaryDirectory() as folder:
        path = drawn.write(Path(folder) / "record.csv")
        result, row = searched_laws(path, drawn.plant.model, settings_of(drawn), drawn.plant.known)
    row = asdict(case) | row
    return row if result is None else row | judged_answers(result, frozenset(), {}, drawn.step)


def said_of_clean(row: Row) -> str:
    """Return the answer to a clean record as a line of text."""
    return f"{words(row)} ({row['seconds']:.0f} s)"


def clean_report(rows: Sequence[Row]) -> Topic:
    """Return tables of what is confirmed, or worth a look, where nothing is hidden."""
    parts: list[str | Table] = [
        f"{len(rows)} records in which nothing is hidden: something is confirmed in"
        f" {share(sum(map(_sure, rows)), len(rows))}, and told as worth looking at in"
        f" {share(sum(map(_worth, rows)), len(rows))} more; {sum('refused' in row for row in rows)}"
        " refused."
    ]
    for axis in ("noise", "stimulus", "plant"):
        parts.append(
            counted(
                rows,
                axis,
                (),
                str,
                confirmed=_sure,
                worth_looking_at=_worth,
                refused=lambda row: "refused" in row,
            )
        )
    false = [row for row in rows if _sure(row) or _worth(row)]
    each = [[title(row, Case), words(row)] for row in false]
    return Topic("Laws of clean records", [*parts, Table(["record", "said"], each)])


def _sure(row: Row) -> bool:
    return bool(row.get("said")) and confirmed(row)


def _worth(row: Row) -> bool:
    return bool(row.get("said")) and not confirmed(row)


def judge_rig(case: RigCase) -> Row:
    """Search the laws of the model of the rig."""
    from demonstrations import draw as draw_rig
    from demonstrations import write
    from studies.judging.laws import judged_answers, searched_laws

    try:
        drawn = draw_rig(case.variation, case.seed, case.strength, duration=_DURATION)
    except ValueError as error:
        return asdict(case) | {"impossible": str(error), "seconds": 0.0}
    with tempfile.TemporaryDirectory() as folder:
        write(drawn, Path(folder) / "record.csv")
        result, row = searched_laws(Path(folder) / "record.csv", "ppy_actuator")
    row = asdict(case) | row | {"widths": drawn.truth.hidden[0].widths}
    step = float(drawn.time[1] - drawn.time[0])
    return (
        row
        if result is None
        else row | judged_answers(result, right_of(case.variation), dict(drawn.inputs), step)
    )


def said_of_rig(row: Row) -> str:
    """Return the answer to a record of the rig as a line of text."""
    if "impossible" in row:
        return row["impossible"]
    return f"{named(row)}: {words(row)} ({row['widths']:.1f} widths, {row['seconds']:.0f} s)"


def rig_report(rows: Sequence[Row]) -> Topic:
    """Return tables of the answers about the rig."""
    drawn = [row for row in rows if "impossible" not in row]
    good = sum(named(row) in GOOD for row in drawn)
    sure = sum(confirmed(row) for row in drawn if "said" in row)
    wrong = [[title(row, RigCase), said_of_rig(row)] for row in drawn if named(row) not in GOOD]
    return Topic(
        "The emulated rig, with the catalogue off",
        [
            (
                f"{len(drawn)} records of variations of which the catalogue has an effect; it is"
                " not looked at. The law and signal of that effect, or one that does the same, are"
                f" first or in a first group in {share(good, len(drawn))}; confirmed in"
                f" {share(sure, len(drawn))}. Left out are variations of sensors."
            ),
            counted(drawn, "variation", SAID, named),
            "What was said of the others:",
            Table(["record", "said"], wrong),
        ],
    )
