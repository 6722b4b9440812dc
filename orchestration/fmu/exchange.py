"""FMUs for model exchange: derivatives and outputs evaluated at given continuous states."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

import fmpy.fmi2 as fmi2
import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.fmu.instance import Fmu

_MOST_EVENTS = 1000  # event iterations at the start


class ExchangeFmu(Fmu):
    """One instance of an FMU for model exchange in continuous-time mode.

    Attributes
    ----------
    samples : bool
        Whether the FMU has time events, as a sampled part has.
    """

    samples = False

    def _load(self) -> Any:
        return fmi2.FMU2Model(
            guid=self.description.guid,
            unzipDirectory=self._folder,
            instanceName=self.name,
            modelIdentifier=self.description.modelExchange.modelIdentifier,
        )

    @property
    def states(self) -> list[str]:
        """Names of the continuous states, in the order of the model structure."""
        return [unknown.variable.derivative.name for unknown in self.description.derivatives]

    @property
    def rates(self) -> list[str]:
        """Names of the state derivatives, in the order of the model structure."""
        return [unknown.variable.name for unknown in self.description.derivatives]

    def enter_continuous_time(self, time: float, states: Sequence[float]) -> None:
        """Iterate the events at the start, enter continuous-time mode, and set time and states.

        Parameters
        ----------
        time : float
            Seconds.
        states : sequence of float
            In the order of `states`.

        Raises
        ------
        UserError
            If the FMU refuses, or its event iteration does not converge.
        """
        for _ in range(_MOST_EVENTS):
            update = self._checked("events", self._slave.newDiscreteStates)
            is_repetition_needed, _, _, _, has_time_event, _ = update
            self.samples |= has_time_event
            if not is_repetition_needed:
                break
        else:
            raise UserError(f"{self.path.name}: its event iteration does not converge at the start")
        self._checked("continuous time", self._slave.enterContinuousTimeMode)
        self._checked("time", self._slave.setTime, time)
        self.set_states(states)

    def get_states(self) -> list[float]:
        """Return the current continuous states."""
        return self._vector(self._slave.getContinuousStates).tolist()

    def set_states(self, states: Sequence[float]) -> None:
        """Set the continuous states; UserError if the FMU refuses."""
        array = (ctypes.c_double * len(states))(*states)
        self._checked("states", self._slave.setContinuousStates, array, len(states))

    def get_rates(self) -> Array:
        """Return the time derivatives of the states; UserError if the FMU refuses."""
        return self._vector(self._slave.getDerivatives)

    def _vector(self, get: object) -> Array:
        """Return the numbers (states,) that an FMI function writes into an array."""
        count = len(self.states)
        array = (ctypes.c_double * count)()
        self._checked("states and derivatives", get, array, count)  # type: ignore[arg-type]
        return np.array(array[:])
