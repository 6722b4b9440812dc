"""Study of the laws of four measured systems: what `ppy laws` answers, and what is known.

No catalogue is given.

`python -m studies.judging.public_laws` writes ``docs/laws-public.md`` and its pictures.
It reads the records where `PPY_PUBLIC_DATA` says, else in `../shared/data`, and the
models of two of them in its folder `models`.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.tables import Cell, Table
from studies.judging.public import DATA
from studies.judging.stamp import DIAGNOSIS, ROOT, stamp

if TYPE_CHECKING:
    from orchestration.api import LawsResult

PAGE = ROOT / "docs" / "laws-public.md"
CODE = (
    *DIAGNOSIS,
    "orchestration/api/diagnosis.py",
    "fmus/kit/corrections.py",
    "fmus/kit/symbolic/perturbed.py",
    "examples/mass_spring_damper.py",
    "examples/positioning_stage.py",
    "examples/follow_stage.py",
    "studies/judging/public_laws.py",
)
_EXAMPLES = ROOT / "examples"
_ROWS = 5  # of the map
_ARROW = 40_000  # samples: its end
_MULTISINE = 49_000  # samples: its beginning
_FITTED = 8192  # samples
_NONE = "–"
_HEAD = (
    "# What the laws of four measured systems lack\n"
    "\n"
    "Drawn by `python -m studies.judging.public_laws`, which asks them as [`ppy "
    "laws`](how-to/laws.md) does: no effects are\n"
    "named before, and none are on offer. Nobody here made the records; they are not part "
    "of this repository.\n"
    "\n"
    "*To first order* are entries of the map of every law over every signal, by what a "
    "curve there would explain of a model\n"
    "that is linear in it; *fitted* are corrections fitted as curves with all parameters "
    "of the model, by the fall of BIC. Of\n"
    "the former, what is alike to a record is fitted once only, and the fits decide. The "
    "errors are of data that no fit has\n"
    "seen, over the spread of these. Seconds are of the run that drew this page, on "
    "{processors} processors.\n"
    "\n"
    "{stamp}\n"
)


@dataclass(frozen=True)
class System:
    """A measured system, and what is known of it.

    Attributes
    ----------
    name : str
        Of its picture.
    title, about, known : str
        What the record is, and what is in it, for the page.
    files : tuple of str
        That it needs, relative to the folder of public data.
    laws, signals : tuple of str
        Any of which is a right answer; the first are those that the page names.
    options : callable
        Of a folder for files in between; gives the arguments of `orchestration.laws`.
    """

    name: str
    title: str
    about: str
    known: str
    files: tuple[str, ...]
    laws: tuple[str, ...]
    signals: tuple[str, ...]
    options: Callable[[Path], dict[str, Any]]

    def absent(self) -> str:
        """Return which files are missing, or nothing."""
        return ", ".join(name for name in self.files if not (DATA / name).exists())

    def is_right(self, law: str, signal: str, memory: str, kind: str) -> bool:
        """Return whether a law is the one known to be incomplete, over a right signal."""
        return law in self.laws and signal in self.signals and not memory and kind == "add"


def _silverbox(folder: Path) -> dict[str, Any]:
    head, *rows = (DATA / "silverbox_snls80mV.csv").read_text(encoding="utf-8").splitlines()
    for name, part in (
        ("arrow", rows[:_ARROW]),
        ("multisine", rows[_MULTISINE : _MULTISINE + _FITTED]),
    ):
        (folder / f"{name}.csv").write_text("\n".join([head, *part]), encoding="utf-8")
    return {
        "record": folder / "multisine.csv",
        "model": f"{_EXAMPLES / 'mass_spring_damper.py'}:MassSpringDamper",
        "holdout": folder / "arrow.csv",
        "mapping": {"input": "force[N]", "output": "position[m]"},
        "interpolate": True,
    }


def _stage(folder: Path) -> dict[str, Any]:
    import runpy

    follow = runpy.run_path(str(_EXAMPLES / "follow_stage.py"))["follow"]
    follow(DATA / "emps_positioning_stage.csv", folder / "followed.csv")
    return {
        "record": folder / "followed.csv",
        "model": f"{_EXAMPLES / 'positioning_stage.py'}:StageFollowed",
        "hold": ["force_constant"],
    }


def _motor(folder: Path) -> dict[str, Any]:
    return {
        "record": DATA / "dc_motor_dead_zone.csv",
        "model": f"{DATA / 'models' / 'dc_motor.py'}:Motor",
        "mapping": {"speed": "speed[rpm]"},
    }


def _cell(folder: Path) -> dict[str, Any]:
    return {
        "record": DATA / "supercapacitor_maxwell_3A.csv",
        "model": f"{DATA / 'models' / 'supercapacitor.py'}:Supercap",
        "holdout": DATA / "supercapacitor_maxwell_2p2A.csv",
    }


SYSTEMS = (
    System(
        "silverbox",
        "Silverbox: a circuit that obeys Duffing's equation",
        f"Volts in are read as newtons, volts out as metres. Fitted to {_FITTED:,} samples of the"
        " multisines, judged on the arrow, whose amplitude goes beyond theirs.",
        "The spring hardens. To its force comes a cube of the position (Wigren, Schoukens, Three"
        " free data sets for development and benchmarking in nonlinear system identification,"
        " 2013), and a small constant.",
        ("silverbox_snls80mV.csv",),
        ("spring_force",),
        ("elongation",),
        _silverbox,
    ),
    System(
        "stage",
        "EMPS: a positioning stage",
        "Motion in, voltage of the drive out, below 10 Hz; the model has a mass and viscous"
        " friction. The last third is held out.",
        "Dry friction, 20.4 N, and slopes that differ by the direction, 167 and 240 N s/m (Janot,"
        " Gautier, Brunot, Data set and reference models of EMPS, 2019).",
        ("emps_positioning_stage.csv",),
        ("friction",),
        ("velocity",),
        _stage,
    ),
    System(
        "motor",
        "A gear motor with a dead zone",
        "A staircase of voltage up and down, speed out; the model is of first order. The last third"
        " is held out, and with it all voltages below -2 V.",
        "Below some voltage the motor does not turn. The model has no law for what the voltage"
        " drives, and so its drag, or the rate of its speed, would have to hang on the voltage in"
        " another way.",
        ("dc_motor_dead_zone.csv", "models/dc_motor.py"),
        ("drag", "omega_rate"),
        ("voltage",),
        _motor,
    ),
    System(
        "cell",
        "A supercapacitor (Maxwell, 25 F) discharged at constant current",
        "Current in, voltage out; one capacitance behind one resistance. Fitted at 3 A, judged at"
        " 2.2 A.",
        "The capacitance depends on the voltage, so that the voltage is a curve of the charge; a"
        " second pair of RC comes after that.",
        (
            "supercapacitor_maxwell_3A.csv",
            "supercapacitor_maxwell_2p2A.csv",
            "models/supercapacitor.py",
        ),
        ("open_voltage",),
        ("charge", "open_voltage"),
        _cell,
    ),
)


def ask(system: System, folder: Path) -> LawsResult:
    """Search the laws of a system."""
    import orchestration as ppy

    return ppy.laws(**system.options(folder))


def section(system: System, result: LawsResult, seconds: float, pictures: Path) -> str:
    """Return the results for a system, with its picture."""
    parts = [
        f"## {system.title}",
        system.about,
        f"What is known: {system.known}",
        f"> {result.sentence}",
    ]
    parts.append(_agreement(system, result))
    picture = pictures / f"laws_{system.name}.svg"
    picture.unlink(missing_ok=True)
    if result.law_map:
        result.plot(picture)
        best = result.law_map[0]
        parts.append(f"![{best['law']} over {best['signal']}](pictures/{picture.name})")
    parts.append(str(_map(result)))
    if result.law_map:
        parts.append(_figures(result))
    details = result.details
    rows = result.diagnosis.details.diagnosis.estimation.time.size
    looked_at = len(details.entries) if details else 0
    parts.append(
        f"{rows:,} samples were fitted and {looked_at:,} entries of the map told anything;"
        f" {seconds:.0f} s."
    )
    return "\n\n".join(parts)


def _agreement(system: System, result: LawsResult) -> str:
    """Return whether an answer agrees with what is known."""
    wanted = f"`{system.laws[0]}` over `{system.signals[0]}`"
    best = next(iter(result.law_map), None)
    if best is not None and system.is_right(
        best["law"], best["signal"], best["memory"], best["kind"]
    ):
        confirmed = "" if best["confirmed"] else ", but unseen data do not bear it out"
        return f"That is the law and the signal that are known: {wanted}{confirmed}."
    entries = result.details.entries if result.details else []
    right = (
        k
        for k, e in enumerate(entries, 1)
        if system.is_right(e.law, e.signal.name, e.signal.memory, e.kind)
    )
    place = next(right, None)
    where = (
        f"to first order it stands at place {place} of the map" if place else "it is not on the map"
    )
    return f"**That is not what is known**, which would be {wanted}: {where}."


def _map(result: LawsResult) -> Table:
    """Return the first entries of the map, and of the corrections that were fitted."""
    entries = result.details.entries if result.details else []
    fitted = result.details.corrections if result.details else []
    rows: list[list[Cell]] = []
    for k in range(min(_ROWS, max(len(entries), len(fitted)))):
        first = (
            [entries[k].label, f"{entries[k].curve.gain:,.0f}"]
            if k < len(entries)
            else [_NONE, _NONE]
        )
        then = (
            [fitted[k].entry.label, f"{fitted[k].gain:,.0f}"] if k < len(fitted) else [_NONE, _NONE]
        )
        rows.append([k + 1, *first, *then])
    return Table(
        ["", "to first order: law, signal", "evidence", "fitted: law, signal", "fall of BIC"], rows
    )


def _figures(result: LawsResult) -> str:
    """Return shape, parameters, errors on unseen data, and what these mean for a correction."""
    from orchestration.discrepancy.report.laws.wording import unseen_data_outcome
    from orchestration.reporting import format_percent

    best = result.law_map[0]  # type: ignore[union-attr]
    correction = result.details.corrections[0]  # type: ignore[union-attr]
    before, after = correction.errors
    nearest = ", ".join(f"{name} {more:+,.0f}" for name, more in correction.shapes)
    rows = {
        "Shape": best["shape"] or "none; a table over the knots",
        "Shapes that were tried, by how far their BIC is above the curve's": nearest,
        "Parameters, SI": ", ".join(
            f"`{name}` {of['value']:.3g}" for name, of in best["parameters"].items()
        ),
        **{
            f"Error of {o} on unseen data": (
                f"{format_percent(before[o])} before, {format_percent(after[o])} after"
            )
            for o in before
        },
        "Unseen data": unseen_data_outcome(correction),
        "Not told apart from it": ", ".join(best["alike"]),
    }
    return "\n".join(f"- {name}: {text}" for name, text in rows.items() if text)


def page(systems: Sequence[System], target: Path, progress: Callable[[str], None] = print) -> str:
    """Search the laws of all systems whose records are there, and draw."""
    pictures = target.parent / "pictures"
    pictures.mkdir(parents=True, exist_ok=True)
    parts = [_HEAD.format(processors=os.cpu_count(), stamp=stamp(CODE)).rstrip()]
    for system in systems:
        if system.absent():
            parts.append(f"## {system.title}\n\nLeft out: {system.absent()} is not there.")
            continue
        with tempfile.TemporaryDirectory() as folder:
            began = clock.perf_counter()
            result = ask(system, Path(folder))
            seconds = clock.perf_counter() - began
        progress(f"{system.title}, {seconds:.0f} s: {result.sentence}")
        parts.append(section(system, result, seconds, pictures))
    return "\n\n".join(parts) + "\n"


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m studies.judging.public_laws", description=__doc__.split("\n\n")[0]
    )
    parser.add_argument(
        "--only", nargs="*", default=[], help=f"of {', '.join(s.name for s in SYSTEMS)}"
    )
    parser.add_argument(
        "--out",
        type=Path,
        help="page to write; default docs/laws-public.md unless some are left out",
    )
    chosen = parser.parse_args(arguments)
    systems = [s for s in SYSTEMS if not chosen.only or s.name in chosen.only]
    out = chosen.out or (PAGE if not chosen.only else ROOT / "build" / "laws" / PAGE.name)
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(page(systems, out, lambda line: print(line, flush=True)), encoding="utf-8")
    print(f"written: {out}")


if __name__ == "__main__":
    main()
