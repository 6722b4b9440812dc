"""A member of a system by itself: its FMU over measured inputs, and how far its outputs can be trusted there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from fmus.kit.storage import scratch
from orchestration.discrepancy.systems.cut import IsolatedMember
from orchestration.discrepancy.systems.inputs import MemberInputs
from orchestration.fmu.archive import unpack
from orchestration.fmu.instance import Fmu
from orchestration.fmu.signal import Value
from orchestration.fmu.simulate import simulate_instance
from orchestration.system.check import interface

Array = NDArray[np.float64]
PARTS = 4  # steps between samples, so that an input can change linearly where the FMU cannot interpolate it
_DRAWS = 2  # of noise on the inputs


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
        What it is fed.
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
        """Of the member in its system."""
        return self.isolated.member.name

    @property
    def outputs(self) -> list[str]:
        """Outputs that are read: all that are real, for what was not measured may tell what a residual is due to."""
        return [
            n
            for n, signal in interface(self.isolated.member).outputs.items()
            if signal.type == "real"
        ]

    def start_values(self, values: Mapping[str, float]) -> dict[str, Value]:
        """Parameters and inputs of the FMU at the first sample; `values` go before parameters of the system."""
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
        """Simulate.

        Parameters
        ----------
        values : Mapping of str to float
            Parameters, besides those of the system.
        thinning : int
            Of the samples of inputs that change between them, one in so many is used.
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
        """Real outputs at the samples, (n,) each."""
        columns = self.inputs.at_samples(thinning, noise).T
        inputs, linear = dict(zip(self.inputs.names, columns, strict=True)), self.inputs.linear
        with Fmu(self.isolated.member.fmu, self.start_values(values), folder=self.folder) as fmu:
            fmu.start(float(self.time[0]), float(self.time[-1]))
            exact = not linear or fmu.description.coSimulation.canInterpolateInputs
            return simulate_instance(
                fmu, self.time, inputs, self.outputs, linear=linear, parts=1 if exact else PARTS
            )

    def input_uncertainty(
        self, simulated: Mapping[str, Array], values: Mapping[str, float]
    ) -> dict[str, float]:
        """How uncertain measured outputs are because inputs are noisy and known at the samples only.

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
        measured = [o for o in simulated if o in self.isolated.outputs]
        power = {
            o: float(np.mean([np.mean((draw[o] - simulated[o]) ** 2) for draw in draws]))
            for o in measured
        }
        if self.inputs.linear:
            coarse = self.simulate(values, thinning=2)
            power = {
                o: p + float(np.mean((coarse[o] - simulated[o]) ** 2)) for o, p in power.items()
            }
        return {o: float(np.sqrt(p)) for o, p in power.items()}


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
