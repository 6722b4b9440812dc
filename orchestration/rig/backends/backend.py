"""What a rig has to be able to do to be served: read all, write all, limits, safe state, close."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping

from orchestration.rig.limit import Limit

__all__ = ["Backend", "Limit", "Steppable"]


class Backend(ABC):
    """One rig. A subclass in a file of its own can be served: ``ppy rig serve --backend file.py:Class``.

    It is made in the process that uses it, with the options of the command line as keyword arguments, all of them
    texts; made means open, and ready for any of the calls below. All values are SI. Whatever a call raises, the rig
    goes to its safe state and the message is told.

    Attributes
    ----------
    inputs : Mapping of str to str
        What can be commanded, and its unit.
    outputs : Mapping of str to str
        What is measured, and its unit.
    limits : Mapping of str to Limit
        Of commands and of measured values.
    """

    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    limits: Mapping[str, Limit]

    @abstractmethod
    def read(self) -> Mapping[str, float]:
        """Take the newest value of every output; NaN where there is none.

        Returns
        -------
        Mapping of str to float
        """

    @abstractmethod
    def write(self, values: Mapping[str, float]) -> None:
        """Command every input.

        Parameters
        ----------
        values : Mapping of str to float
        """

    @abstractmethod
    def safe(self) -> None:
        """Bring the rig to its safe state: no current, no coil voltage; at any time, also right after opening."""

    @abstractmethod
    def close(self) -> None:
        """Let go of the device; the rig stays as it is."""


class Steppable(Backend):
    """A rig whose time can be somebody else's: an emulated one, for lockstep."""

    @abstractmethod
    def advance(self, step: float) -> None:
        """Let time pass with the commands held.

        Parameters
        ----------
        step : float
            In s.
        """
