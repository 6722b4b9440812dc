"""Make the table of the page of calls from what an FMU writes down while it is used.

``python docs/make_calling_sequence.py`` writes it anew: an FMU that notes every call is used by
each command, for both versions of FMI and both interfaces, and what it notes is held against the
tables of the standards on the way.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "reference" / "calling-sequence.md"
sys.path.insert(0, str(ROOT))

import orchestration as ppy  # noqa: E402
from orchestration.system import Member, Port, System  # noqa: E402
from tests.support.fmi_states import faults  # noqa: E402
from tests.support.recording import Call, by_instance, recorded, recorder  # noqa: E402

_HEAD = "| FMI | interface | command | tolerance, start, stop | calls |"
_SOLVER = {
    "SetTime",
    "SetContinuousStates",
    "GetDerivatives",
    "GetContinuousStates",
    "GetNominalsOfContinuousStates",
    "GetEventIndicators",
    "CompletedIntegratorStep",
}
_LONGEST = 4  # calls of a part that is repeated
TIME = 0.1 * np.arange(120)
U = np.where(np.arange(120) % 50 < 25, 2.0, 3.0)


def record() -> dict[str, Any]:
    """Return a record of the FMU with k = 1.7 and tau = 1.5, with a little noise."""
    x = np.empty_like(TIME)
    x[0] = U[0]
    for k in range(TIME.size - 1):
        x[k + 1] = x[k] - np.expm1(-0.1 / 1.5) * (U[k] - x[k])
    noise = 1e-3 * np.random.default_rng(1).standard_normal(TIME.size)
    return {"time": TIME, "u": U, "y": 1.7 * x + noise}


def tasks(fmu: str) -> dict[str, Callable[[], Any]]:
    """Return what is done with an FMU, by command."""
    system = System("one", (Member("one", Path(fmu), {}, None),), (), {"u": (Port("one", "u"),)})
    return {
        "simulate": lambda: ppy.simulate(fmu, {"u": 2.0}),
        "sweep": lambda: ppy.sweep(fmu, {"k": [1.0, 2.0, 3.0], "u": [1.0, 2.0]}),
        "compare": lambda: ppy.compare(record(), fmu, settings={"tau": 1.5}),
        "identify": lambda: ppy.fit(record(), fmu, "k", settings={"tau": 1.5}),
        "diagnose": lambda: ppy.diagnose(record(), fmu, settings={"tau": 1.5, "k": 1.7}),
        "linearise": lambda: ppy.linearise(fmu),
        "run": lambda: ppy.run(system, TIME, {"u": U}),
    }


def rows() -> Iterator[tuple[str, ...]]:
    """Yield a row for each version, interface and command; an AssertionError for a fault."""
    for version in (2, 3):
        for interface in ("CoSimulation", "ModelExchange"):
            for command, task in tasks(str(recorder(version, (interface,)))).items():
                _, calls = recorded(task)
                lives = by_instance(calls)
                found = [fault for life in lives for fault in faults(life, version)]
                assert not found, (command, version, interface, found[:3])
                first = max(lives, key=len)
                yield f"{version}.0", interface, command, *_shown(first)


def _shown(life: Sequence[Call]) -> tuple[str, str]:
    """Return what an instance is told, and its calls, without those of further runs."""
    names = [call.function for call in life]
    setup = next(call for call in life if len(call.arguments) == 5)
    _, tolerance, start, _, stop = map(float, setup.arguments)
    told = f"{tolerance:g}, {start:g} s, {stop:g} s"
    if "Reset" in names:
        again = names.index("Reset")
        return told, ", ".join([*_shortened(names[:again]), "Reset, …", *names[-2:]])
    return told, ", ".join(_shortened(names))


def _shortened(names: Sequence[str]) -> list[str]:
    """Return names of calls with those of a solver as one, and repeated parts once."""
    merged: list[str] = []
    for name in names:
        word = "*solver*" if name in _SOLVER else name
        if not (word == "*solver*" and merged[-1:] == [word]):
            merged.append(word)
    shown: list[str] = []
    while merged:
        length = next((n for n in range(_LONGEST, 0, -1) if merged[:n] == merged[n : 2 * n]), 0)
        part = merged[: length or 1]
        shown.append(f"({', '.join(part)})…" if length else part[0])
        del merged[: len(part)]
        while length and merged[:length] == part:
            del merged[:length]
    return shown


def page() -> str:
    """Return the text of the page: what stands above its table, and a new table."""
    introduction = PAGE.read_text(encoding="utf-8").partition(_HEAD)[0].rstrip()
    lines = [introduction, "", _HEAD, "|---|---|---|---|---|"]
    lines += [f"| {' | '.join(row)} |" for row in rows()]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
