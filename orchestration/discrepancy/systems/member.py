"""A member of a system by itself: its FMU over measured inputs, and how far its outputs can be trusted there."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from fmus.kit.errors import UserError
from orchestration.discrepancy.systems.cut import IsolatedMember
from orchestration.fmu.archive import unpack
from orchestration.fmu.instance import Fmu
from orchestration.system.check import interface

Array = NDArray[np.float64]
PARTS = 4  # steps between samples, so that an input can change from one to the next
_SAME = 1e-3  # of the logarithm of sizes
_DRAWS = 2  # of noise on the inputs


def floor(values: Array) -> float:
    """Standard deviation of white noise on a signal, told by how its slope changes; steps of the signal do no harm."""
    bends = np.diff(values[np.isfinite(values)], 2)
    return float(np.median(np.abs(bends)) / norm.ppf(0.75) / np.sqrt(6.0)) if bends.size else 0.0


class BudgetExceeded(Exception):
    """There are no more simulations to make."""


@dataclass
class MemberSimulation:
    """A member that is simulated over a record.

    Attributes
    ----------
    cut : IsolatedMember
    time : ndarray, shape (n,)
    folder : str
        Where its FMU is unzipped.
    most : int
        Simulations that may be made.
    tell : callable
        Told the number made.
    held : set of str
        Inputs that are held between samples; the others change linearly.
    made : int
        Simulations so far.
    """

    cut: IsolatedMember
    time: Array
    folder: str
    most: int
    tell: Callable[[int], None]
    held: set[str] = field(default_factory=set)
    made: int = 0

    def simulate(
        self, values: Mapping[str, float], every: int = 1, disturbed: np.random.Generator | None = None
    ) -> dict[str, Array]:
        """Simulate.

        Parameters
        ----------
        values : Mapping of str to float
            Parameters, besides those of the system.
        every : int
            Of the samples of inputs that change between them, those that are used.
        disturbed : Generator, optional
            Adds as much noise to the measured inputs as they seem to have.

        Returns
        -------
        dict of str to ndarray, shape (n,)

        Raises
        ------
        BudgetExceeded
            If there is no simulation left.
        UserError
            If the FMU fails.
        """
        if self.made >= self.most:
            raise BudgetExceeded
        self.made += 1
        self.tell(self.made)
        outputs = self.shown
        at, between = self._inputs(every, disturbed)
        constant = {n: f.value for n, f in self.cut.inputs.items() if f.value is not None}
        parts = PARTS if self.moving else 1
        given = {**self.cut.member.parameters, **constant, **values}
        driven = {n: float(f.values[0]) for n, f in self.cut.inputs.items() if f.values is not None}
        result = np.full((self.time.size, len(outputs)), np.nan)
        with Fmu(self.cut.member.fmu, given | driven, folder=self.folder) as fmu:
            fmu.start(float(self.time[0]), float(self.time[-1]))
            feed, read = fmu.writer(list(driven)), fmu.reader(outputs)
            points = self.time.tolist()
            for k, now in enumerate(points):
                feed(at[k])
                read(result[k])
                if k + 1 == len(points):
                    break
                size = (points[k + 1] - now) / parts
                for part in range(parts):
                    if self.moving:
                        feed(between[part, k])
                    begin = now + part * size
                    fmu.step(begin, size if part + 1 < parts else points[k + 1] - begin)
        found = {name: result[:, i] for i, name in enumerate(outputs)}
        for name, column in found.items():
            if not np.isfinite(column).all():
                raise UserError(f"{self.cut.member.name}: {name} is not a finite number")
        return found

    @property
    def shown(self) -> list[str]:
        """Outputs that are read: all that are real, for what was not measured may tell what a residual is due to."""
        return [n for n, signal in interface(self.cut.member).outputs.items() if signal.type == "real"]

    @property
    def moving(self) -> list[str]:
        """Inputs that change between samples."""
        fed = self.cut.inputs.items()
        return [n for n, f in fed if f.values is not None and f.smooth and n not in self.held]

    def _inputs(self, every: int, disturbed: np.random.Generator | None) -> tuple[Array, Array]:
        """Values of the measured inputs (n, m) at the samples, and (parts, n - 1, m) halfway through every part."""
        columns = {n: f.values for n, f in self.cut.inputs.items() if f.values is not None}
        at = np.column_stack([np.zeros(self.time.size), *columns.values()])[:, 1:]
        for i, name in enumerate(columns):
            if every > 1 and name in self.moving:
                kept = np.unique([*range(0, self.time.size, every), self.time.size - 1])
                at[:, i] = np.interp(self.time, self.time[kept], at[kept, i])
        for i, name in enumerate(columns):
            if disturbed is not None and self.cut.inputs[name].smooth:
                at[:, i] += floor(at[:, i]) * disturbed.standard_normal(self.time.size)
        slope = np.diff(at, axis=0) * [name in self.moving for name in columns]
        shares = (np.arange(PARTS) + 0.5) / PARTS
        return at, at[:-1] + shares[:, np.newaxis, np.newaxis] * slope

    def doubt(self, simulated: Mapping[str, Array], values: Mapping[str, float]) -> dict[str, float]:
        """How uncertain outputs are because inputs are noisy and known at the samples only: rms, in their units."""
        random = np.random.default_rng(0)
        others = [self.simulate(values, disturbed=random) for _ in range(_DRAWS)]
        moved = {
            o: float(np.mean([np.mean((s[o] - y) ** 2) for s in others]))
            for o, y in simulated.items()
            if o in self.cut.outputs
        }
        if self.moving:
            coarse = self.simulate(values, every=2)
            moved = {o: v + float(np.mean((coarse[o] - simulated[o]) ** 2)) for o, v in moved.items()}
        return {o: float(np.sqrt(v)) for o, v in moved.items()}

    def choose_holding(self, values: Mapping[str, float]) -> None:
        """Find which inputs are held between samples: those with which the outputs move as they were measured to."""
        self.held = set()
        best = self._roughness(values)
        for name in self.moving:
            self.held.add(name)
            held = self._roughness(values)
            if held < best + _SAME:  # where it makes no difference, nothing happens between samples
                best = min(best, held)
            else:
                self.held.discard(name)

    def _roughness(self, values: Mapping[str, float]) -> float:
        """Logarithm of the size of the steps that residuals make from sample to sample, summed over outputs."""
        simulated = self.simulate(values)
        steps = [np.diff(simulated[o] - y) for o, y in self.cut.outputs.items()]
        return float(sum(np.log(np.sqrt(np.nanmean(s**2)) + np.finfo(float).tiny) for s in steps))


@contextmanager
def opened(cut: IsolatedMember, time: Array, most: int, tell: Callable[[int], None]) -> Iterator[MemberSimulation]:
    """Unzip the FMU of a member for as long as it is simulated."""
    folder = unpack(cut.member.fmu)
    try:
        yield MemberSimulation(cut, time, folder, most, tell)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
