"""Simulation of a member of a system by itself: its FMU over measured inputs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from fmus.kit.storage import scratch
from orchestration.discrepancy.systems.cut import InputSource, IsolatedMember
from orchestration.fmu import Fmu, Value, unpack
from orchestration.fmu.simulation import simulate_instance
from orchestration.identify.noise import noise_std
from orchestration.system import interface

# steps between samples, so that an input can change linearly where the FMU cannot interpolate it
PARTS = 4
_DRAWS = 2  # of noise on the inputs
_NO_DIFFERENCE = 1e-3  # of the logarithm of the sizes of steps of residuals


class MemberInputs:
    """Inputs of a member over a record: measured at the samples, held or linear between them.

    Parameters
    ----------
    sources : Mapping of str to InputSource
    time : ndarray, shape (n,)
        Seconds.

    Attributes
    ----------
    constant : dict of str to float
        Inputs that stay at a value.
    names : list of str
        Measured inputs.
    columns : ndarray, shape (n, m)
        Their values.
    held : set of str
        Continuous inputs that are held between samples; the others change linearly.
    """

    def __init__(self, sources: Mapping[str, InputSource], time: Array):
        measured = {
            name: source.values for name, source in sources.items() if source.values is not None
        }
        self.constant = {
            name: source.value for name, source in sources.items() if source.value is not None
        }
        self.names = list(measured)
        columns = np.column_stack([np.zeros(time.size), *measured.values()])  # there may be none
        self.columns = columns[:, 1:]
        self.continuous = [name for name in measured if sources[name].continuous]
        self.held: set[str] = set()
        self._time = time

    @property
    def linear(self) -> list[str]:
        """Inputs that change between samples."""
        return [name for name in self.continuous if name not in self.held]

    @property
    def first(self) -> dict[str, float]:
        """Measured inputs at the first sample."""
        return dict(zip(self.names, self.columns[0].tolist(), strict=True))

    def at_samples(self, thinning: int = 1, noise: np.random.Generator | None = None) -> Array:
        """Return the values of the measured inputs at the samples.

        Parameters
        ----------
        thinning : int
            Of inputs that are linear between samples one sample in so many is kept, with straight
            lines between: the difference shows what their course between samples can do.
        noise : Generator, optional
            Adds as much noise to continuous inputs as they seem to have.

        Returns
        -------
        ndarray, shape (n, m)
        """
        values = self.columns.copy()
        for i, name in enumerate(self.names):
            if thinning > 1 and name in self.linear:
                values[:, i] = thinned(self._time, values[:, i], thinning)
        for i, name in enumerate(self.names):
            if noise is not None and name in self.continuous:
                values[:, i] += noise_std(values[:, i]) * noise.standard_normal(self._time.size)
        return values

    def changes(self, values: Array) -> Array:
        """Return by how much inputs (n, m) change between samples, (n - 1, m); not where held."""
        return np.diff(values, axis=0) * [name in self.linear for name in self.names]


def thinned(time: Array, values: Array, thinning: int) -> Array:
    """Return one in so many samples, the last one too, and straight lines between them, (n,)."""
    kept = np.unique([*range(0, time.size, thinning), time.size - 1])
    return np.interp(time, time[kept], values[kept])


class BudgetExceeded(Exception):
    """There are no more simulations to make."""


@dataclass
class MemberSimulation:
    """A member that is simulated over a record, a limited number of times.

    Attributes
    ----------
    isolated : IsolatedMember
    time : ndarray, shape (n,)
        Seconds.
    folder : str
        Where its FMU is unzipped.
    budget : int
        Simulations that may be made.
    progress : callable
        Told the number made.
    used : int
        Simulations made.
    inputs : MemberInputs
    """

    isolated: IsolatedMember
    time: Array
    folder: str
    budget: int
    progress: Callable[[int], None]
    used: int = field(default=0, init=False)
    inputs: MemberInputs = field(init=False)

    def __post_init__(self) -> None:
        self.inputs = MemberInputs(self.isolated.inputs, self.time)

    @property
    def name(self) -> str:
        """Name of the member in its system."""
        return self.isolated.member.name

    @property
    def outputs(self) -> list[str]:
        """Outputs that are read: all that are real.

        Those that were not measured may be what a residual is due to.
        """
        declared = interface(self.isolated.member).outputs
        return [name for name, signal in declared.items() if signal.type == "real"]

    def start_values(self, values: Mapping[str, float]) -> dict[str, Value]:
        """Return parameters and inputs of the FMU at the first sample.

        Parameters
        ----------
        values : Mapping of str to float
            Parameters, which go before those of the system.
        """
        return {
            **self.isolated.member.parameters,
            **self.inputs.constant,
            **values,
            **self.inputs.first,
        }

    def simulate(
        self,
        values: Mapping[str, float],
        thinning: int = 1,
        noise: np.random.Generator | None = None,
    ) -> dict[str, Array]:
        """Simulate the member over the record.

        Parameters
        ----------
        values : Mapping of str to float
            Parameters, besides those of the system.
        thinning : int
            Of inputs that are linear between samples one sample in so many is kept, with straight
            lines between: the difference shows what their course between samples can do.
        noise : Generator, optional
            Adds as much noise to the measured inputs as they seem to have.

        Returns
        -------
        dict of str to ndarray, shape (n,)
            All real outputs, in their units.

        Raises
        ------
        BudgetExceeded
            If there is no simulation left.
        UserError
            If the FMU fails.
        """
        if self.used >= self.budget:
            raise BudgetExceeded
        self.used += 1
        self.progress(self.used)
        simulated = self._run(values, thinning, noise)
        for output, column in simulated.items():
            if not np.isfinite(column).all():
                raise UserError(f"{self.name}: {output} is not a finite number")
        return simulated

    def _run(
        self, values: Mapping[str, float], thinning: int, noise: np.random.Generator | None
    ) -> dict[str, Array]:
        """Return real outputs at the samples, (n,) each.

        An FMU that cannot interpolate inputs takes several steps per sample, over which an input
        that is linear between samples changes.
        """
        columns = self.inputs.at_samples(thinning, noise).T
        inputs = dict(zip(self.inputs.names, columns, strict=True))
        linear = self.inputs.linear
        with Fmu(self.isolated.member.fmu, self.start_values(values), folder=self.folder) as fmu:
            fmu.start(float(self.time[0]), float(self.time[-1]))
            follows_slopes = not linear or fmu.description.coSimulation.canInterpolateInputs
            return simulate_instance(
                fmu,
                self.time,
                inputs,
                self.outputs,
                linear=linear,
                parts=1 if follows_slopes else PARTS,
            )

    def input_uncertainty(
        self, simulated: Mapping[str, Array], values: Mapping[str, float]
    ) -> dict[str, float]:
        """Estimate how uncertain outputs are, as inputs are noisy and known at the samples only.

        Parameters
        ----------
        simulated : Mapping of str to ndarray, shape (n,)
            With these values.
        values : Mapping of str to float
            Parameters.

        Returns
        -------
        dict of str to float
            RMS, in the units of the outputs.
        """
        random = np.random.default_rng(0)
        draws = [self.simulate(values, noise=random) for _ in range(_DRAWS)]
        coarse = self.simulate(values, thinning=2) if self.inputs.linear else None
        uncertainty = {}
        for output in simulated:
            if output not in self.isolated.outputs:
                continue
            power = float(np.mean([_mean_square(draw, simulated, output) for draw in draws]))
            if coarse is not None:
                power += float(_mean_square(coarse, simulated, output))
            uncertainty[output] = float(np.sqrt(power))
        return uncertainty


def _mean_square(
    simulated: Mapping[str, Array], reference: Mapping[str, Array], output: str
) -> np.floating[Any]:
    """Return the mean square by which two simulations of an output differ."""
    return np.mean((simulated[output] - reference[output]) ** 2)


@contextmanager
def opened(
    isolated: IsolatedMember, time: Array, budget: int, progress: Callable[[int], None]
) -> Iterator[MemberSimulation]:
    """Unzip the FMU of a member for as long as it is simulated."""
    folder = unpack(isolated.member.fmu)
    try:
        yield MemberSimulation(isolated, time, folder, budget, progress)
    finally:
        scratch.remove(folder)


def choose_interpolation(simulation: MemberSimulation, values: Mapping[str, float]) -> None:
    """Choose which inputs are held between samples, which no record shows, by the outputs.

    An input is held if the outputs then move more as they were measured to.

    Parameters
    ----------
    simulation : MemberSimulation
        Its inputs are changed.
    values : Mapping of str to float
        Parameters.
    """
    inputs = simulation.inputs
    inputs.held = set()
    best = _roughness(simulation, values)
    for name in inputs.linear:
        inputs.held.add(name)
        held = _roughness(simulation, values)
        # where it makes no difference, nothing happens between samples
        if held < best + _NO_DIFFERENCE:
            best = min(best, held)
        else:
            inputs.held.discard(name)


def _roughness(simulation: MemberSimulation, values: Mapping[str, float]) -> float:
    """Return the logarithm of the steps of residuals from sample to sample, summed over outputs."""
    simulated = simulation.simulate(values)
    steps = [np.diff(y - simulated[o]) for o, y in simulation.isolated.outputs.items()]
    return float(sum(np.log(np.sqrt(np.nanmean(s**2)) + np.finfo(float).tiny) for s in steps))
