"""An FMU for model exchange: its laws evaluated at given states, for derivatives of these laws."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Sequence

import fmpy.fmi2 as fmi2
import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.fmu.instance import Fmu

_MOST_EVENTS = 1000  # iterations until discrete states have settled


class ExchangeFmu(Fmu):
    """One instance of an FMU for model exchange, started and held at a time.

    Attributes
    ----------
    samples : bool
        Whether the FMU has events at times that it knows, so that something is sampled in it.
    """

    samples = False

    def _instantiate(self) -> None:
        try:
            self._slave = fmi2.FMU2Model(
                guid=self.description.guid,
                unzipDirectory=self._folder,
                instanceName=self.name,
                modelIdentifier=self.description.modelExchange.modelIdentifier,
            )
        finally:
            os.chdir(self._working_folder)  # where loading fails, fmpy leaves the process there
        self._slave.instantiate(callbacks=self._log.callbacks)
        self._setters = {}

    @property
    def states(self) -> list[str]:
        """Names of the continuous states, in the order of the model structure."""
        return [unknown.variable.derivative.name for unknown in self.description.derivatives]

    @property
    def rates(self) -> list[str]:
        """Names of their derivatives."""
        return [unknown.variable.name for unknown in self.description.derivatives]

    def hold(self, time: float, states: Sequence[float]) -> None:
        """Go to a time and to states, after the events at the start.

        Parameters
        ----------
        time : float
            Seconds.
        states : sequence of float
            In the order of `states`.

        Raises
        ------
        UserError
            If the FMU refuses, or its discrete states do not settle.
        """
        for _ in range(_MOST_EVENTS):
            again, _, _, _, defined, _ = self._checked("events", self._slave.newDiscreteStates)
            self.samples |= defined
            if not again:
                break
        else:
            raise UserError(f"{self.path.name}: its discrete states do not settle at the start")
        self._checked("continuous time", self._slave.enterContinuousTimeMode)
        self._checked("time", self._slave.setTime, time)
        self.set_states(states)

    def start_states(self) -> list[float]:
        """Return the states as they are."""
        return self._vector(self._slave.getContinuousStates).tolist()

    def set_states(self, states: Sequence[float]) -> None:
        """Set the continuous states; UserError if the FMU refuses."""
        held = (ctypes.c_double * len(states))(*states)
        self._checked("states", self._slave.setContinuousStates, held, len(states))

    def get_rates(self) -> Array:
        """Return the time derivatives of the states; UserError if the FMU refuses."""
        return self._vector(self._slave.getDerivatives)

    def _vector(self, get: object) -> Array:
        count = len(self.states)
        held = (ctypes.c_double * count)()
        self._checked("states and derivatives", get, held, count)  # type: ignore[arg-type]
        return np.array(held[:])
