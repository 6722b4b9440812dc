"""Interface of a backend: the calls by which a rig is served."""

from __future__ import annotations

import os
import stat
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from orchestration.rig.signals import Limit

__all__ = ["Backend", "Limit", "Steppable", "place"]


class Backend(ABC):
    """One rig behind the server.

    A subclass in a file of its own can be served: ``ppy rig serve --backend file.py:Class``. It is
    made in the process that uses it, with the options of the command line as keyword arguments, all
    of them texts; once made it is open, and ready for any of the calls below. All values are SI.
    If a call raises any exception, the rig goes to its safe state and the message is logged.

    Attributes
    ----------
    inputs : Mapping of str to str
        Commanded signals and their units.
    outputs : Mapping of str to str
        Measured signals and their units.
    limits : Mapping of str to Limit
        Limits of commands and of measured values, by signal.
    safe_values : Mapping of str to float
        Values of inputs in the safe state; zero for those that are not in it.
    attributes : Mapping of str to Mapping
        Numbers and texts that describe a signal, such as its ``standard_uncertainty`` in SI, by
        signal and name; they go with every record.
    """

    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    limits: Mapping[str, Limit]
    safe_values: Mapping[str, float] = MappingProxyType({})
    attributes: Mapping[str, Mapping[str, float | str]] = MappingProxyType({})

    @classmethod
    def devices(cls, **options: str) -> Sequence[str]:
        """Return the names of the devices that a backend with these options would open.

        Only one server on a machine may have a device. A backend that can find the same device
        under other options should return a name such as its serial number or address; one that
        commands nothing real has no names.

        Parameters
        ----------
        **options
            Keyword arguments of the class.

        Returns
        -------
        sequence of str
            Names; by default one of the class and its options, whatever file it is in. An option
            that is a path counts as what it leads to, a device of the system as its number.
        """
        given = "".join(f" {key}={place(value)}" for key, value in sorted(options.items()))
        return [f"{cls.__qualname__}{given}"]

    @abstractmethod
    def read(self) -> Mapping[str, float]:
        """Return the newest value of every output; NaN for one without a value.

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

    def read_back(self) -> Mapping[str, float]:
        """Return the values of inputs that the device reports.

        Returns
        -------
        Mapping of str to float
            Values of some inputs, or of none.
        """
        return {}

    def heartbeat(self, level: bool) -> None:
        """Set the line by which a relay or a controller watches the server.

        It changes with the samples, 50 times a second at most, as long as all processes of the
        server are heard and the device does not deny its safe state; then it stays as it is, and
        the relay has to drop. A backend without such a line does not define this.

        Parameters
        ----------
        level : bool
        """
        raise NotImplementedError

    @abstractmethod
    def safe(self) -> None:
        """Bring the rig to its safe state: no current, no coil voltage.

        It may be called at any time, also right after opening.
        """

    @abstractmethod
    def close(self) -> None:
        """Release the device; the rig stays as it is."""


def place(option: str) -> str:
    """Return an option, or what it leads to if it is a path; a device of the system as its number.

    Parameters
    ----------
    option : str

    Returns
    -------
    str
    """
    try:
        found = os.stat(option)
    except (OSError, ValueError):
        return option
    if hasattr(os, "major") and stat.S_ISCHR(found.st_mode):
        return f"{os.major(found.st_rdev)}:{os.minor(found.st_rdev)}"
    return os.path.realpath(option)


class Steppable(Backend):
    """A rig whose time the client can advance, such as an emulated one, for lockstep."""

    @abstractmethod
    def advance(self, step: float) -> None:
        """Let time pass under the present commands.

        Parameters
        ----------
        step : float
            Seconds.
        """
