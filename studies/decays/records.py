"""Records of decays, drawn by SciPy's integrator, with noise of a data logger."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from fmus.kit.arrays import Array
from studies.decays.kinds import KINDS, Decay

_SPECIMEN = 0.2  # logarithm, of a parameter over nominal, at most
_NOISE = 1e-3, 1e-2  # of the spread of the output
_MODELS = Path(__file__).parent / "models" / "decays.py"


@dataclass(frozen=True)
class DecayCase:
    """A record to draw: kind, whether a law is hidden in it, number of runs, and seed."""

    kind: str
    hidden: bool
    runs: int
    seed: int

    def __str__(self) -> str:
        """Return the case as a line of text."""
        what = "hidden" if self.hidden else "clean"
        return f"{self.kind}, {what}, {self.runs} run{'s' * (self.runs > 1)}, {self.seed}"


@dataclass(frozen=True)
class DecayRecord:
    """Runs as they were measured, and what they come from.

    Attributes
    ----------
    kind : Decay
    runs : list of tuple of ndarray, shape (n,)
        Time, s, and output, SI.
    truth : dict of str to float
        Parameters of the specimen.
    """

    kind: Decay
    runs: list[tuple[Array, Array]]
    truth: dict[str, float]

    @property
    def model(self) -> str:
        """The model under test, as it is given to a diagnosis."""
        return f"{_MODELS}:{self.kind.model}"


def cases(each: int, seed: int) -> list[DecayCase]:
    """Draw records of every kind, with a law hidden and without, every third of two runs."""
    drawn = []
    for number, name in enumerate(KINDS):
        for k in range(each):
            for hidden in (True, False):
                runs = 2 if (number + k) % 3 == 2 else 1
                own = 100_000 * seed + 1_000 * number + 10 * k + hidden
                drawn.append(DecayCase(name, hidden, runs, own))
    return drawn


def draw(case: DecayCase) -> DecayRecord:
    """Draw a record; the same one for the same case."""
    kind = KINDS[case.kind]
    rng = np.random.default_rng(case.seed)
    truth = {
        name: value * float(np.exp(_SPECIMEN * rng.uniform(-1.0, 1.0)))
        for name, value in kind.nominal.items()
        if name not in kind.known
    }
    truth |= {name: kind.nominal[name] for name in kind.known}
    size = kind.hidden * rng.uniform(0.7, 1.4) * case.hidden
    level = float(np.exp(rng.uniform(*np.log(_NOISE))))
    runs = [_run(kind, truth, size, level, rng) for _ in range(case.runs)]
    return DecayRecord(kind, runs, truth)


def _run(
    kind: Decay, truth: dict[str, float], size: float, level: float, rng: np.random.Generator
) -> tuple[Array, Array]:
    time = np.linspace(0.0, kind.duration, kind.samples)
    start = [rng.uniform(*ends) for ends in kind.starts]
    if kind.model == "Recovery":  # what is hidden is how much of it recovers slowly
        start[1] = size * start[0]
    solved = solve_ivp(
        lambda _, x: kind.rates(x, truth, size),
        (0.0, kind.duration),
        start,
        "LSODA",
        time,
        rtol=1e-9,
        atol=1e-9 * np.abs(start).max(),
    )
    shown = kind.shown(solved.y, truth)
    return time, shown + level * np.std(shown) * rng.standard_normal(len(time))


def write(record: DecayRecord, folder: Path) -> list[Path]:
    """Write every run to a file of its own."""
    name, unit = record.kind.output
    paths = []
    for number, (time, output) in enumerate(record.runs, 1):
        path = folder / f"run_{number}.csv"
        table = np.column_stack([time, output])
        header = f"time [s],{name} [{unit}]"
        np.savetxt(path, table, "%.9g", ",", header=header, comments="")
        paths.append(path)
    return paths
