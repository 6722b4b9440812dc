"""Running one co-simulation FMU, anybody's: open it, feed it, read it; every failure is one readable line."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from typing import Any

import fmpy.fmi2 as fmi2
import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.fmu.isolation.box import noted
from orchestration.fmu.shared_library.calls import Transfer, bind, transfers
from orchestration.fmu.shared_library.opened import OpenedFmu
from orchestration.fmu.signal import check_type, is_text, type_of

Array = NDArray[np.float64]


class Fmu(OpenedFmu):
    """One instance of an FMU; a context manager that frees it and removes its unzipped folder.

    Parameters
    ----------
    path : Path
        The ``.fmu`` file.
    parameters : Mapping[str, float | str], optional
        Start values by name, in the FMU's units; texts for strings.
    name : str, optional
        Of the instance; default the model's.
    folder : str, optional
        Where it is unzipped already, for several instances; it stays.

    Raises
    ------
    UserError
        If it cannot be opened on this machine, refuses to start, or has no variable of a given name.

    Attributes
    ----------
    description : fmpy.model_description.ModelDescription
    variables : dict
        Scalar variables by name.
    warnings : int
        How many calls ended with a warning.
    corrupted : bool
        Whether one ended as fatal: it must not be called again.
    label : str
        What it is called where several speak.
    """

    def start(self, time: float = 0.0, stop: float | None = None) -> None:
        """Set the parameters and initialize.

        Parameters
        ----------
        time, stop : float
            Start time, and stop time if there is one, in seconds.

        Raises
        ------
        UserError
            With the FMU's own message if it refuses.
        """
        self.enter_initialization(time, stop)
        self.exit_initialization()

    def enter_initialization(self, time: float = 0.0, stop: float | None = None) -> None:
        """Do the first part of `start`; until `exit_initialization`, inputs and outputs can be exchanged."""
        self._checked("setup", self._slave.setupExperiment, None, time, stop)
        for name, value in self.parameters.items():
            variable, where = self.variable(name), f"{self.path.name}: {name}"
            if (role := variable.causality or "local") not in ("parameter", "input"):
                raise UserError(f"{where} is {role}, only parameters and inputs can be set")
            if is_text(type_of(variable), value, where):
                self._checked(
                    f"setting {name}", self._slave.setString, [variable.valueReference], [value]
                )
            else:
                (self._setters.get(name) or self._setters.setdefault(name, self.writer([name])))(
                    np.array([value])
                )
        self._checked("initialization", self._slave.enterInitializationMode)

    def exit_initialization(self) -> None:
        """Do the second part of `start`."""
        self._checked("initialization", self._slave.exitInitializationMode)

    def step(self, time: float, size: float) -> None:
        """Make a communication step.

        Parameters
        ----------
        time, size : float
            Where it begins and how long it is, in seconds.

        Raises
        ------
        UserError
            If the FMU fails or discards it, with the FMU's message.
        """
        status = self._do_step(self._slave.component, time, size, 1)
        if status > fmi2.fmi2Warning:
            raise self.failed(f"step from {time:g} s", status)
        self.warnings += status

    def save(self) -> Any:
        """Return a copy of the whole state, to `restore` any number of times and to `release` in the end.

        Raises
        ------
        UserError
            If the FMU cannot.
        """
        if self.description.coSimulation.canGetAndSetFMUstate:
            return self._checked("saving the state", self._slave.getFMUstate)
        raise UserError(f"{self.path.name}: cannot save its state (canGetAndSetFMUstate is false)")

    def restore(self, state: Any) -> None:
        """Go back to a saved state; UserError if the FMU refuses."""
        self._checked("restoring a state", self._slave.setFMUstate, state)

    def release(self, state: Any) -> None:
        """Free a saved state; UserError if the FMU refuses."""
        self._checked("releasing a state", self._slave.freeFMUstate, state)

    def writer(self, names: Sequence[str]) -> Callable[[Array], None]:
        """Return a function that sets variables to a row of numbers, one for each name.

        Parameters
        ----------
        names : sequence of str

        Returns
        -------
        callable
            Takes an array of shape (n,); UserError if the FMU refuses, or a type cannot hold its value.
        """
        prepared = self._transfers("Set", names)

        def write(row: Array) -> None:
            for call, kind, own, where, references, values in prepared:
                chosen = row[where].tolist()
                if kind != "real":
                    for name, value in zip(own, chosen, strict=True):
                        check_type(kind, value, f"{self.path.name}: {name}")
                    chosen = [int(value) for value in chosen]
                values[:] = chosen
                status = call(self._slave.component, references, len(values), values)
                if status > fmi2.fmi2Warning:
                    raise self.failed(f"setting {', '.join(names)}", status)
                self.warnings += status

        return write

    def reader(self, names: Sequence[str]) -> Callable[[Array], None]:
        """Return a function that fills a row of numbers with the values of variables.

        Parameters
        ----------
        names : sequence of str

        Returns
        -------
        callable
            Takes an array of shape (n,); UserError if the FMU refuses.
        """
        prepared = self._transfers("Get", names)

        def read(row: Array) -> None:
            for call, _, _, where, references, values in prepared:
                status = call(self._slave.component, references, len(values), values)
                if status > fmi2.fmi2Warning:
                    raise self.failed(f"reading {', '.join(names)}", status)
                self.warnings += status
                row[where] = values[:]

        return read

    def slope_writer(self, names: Sequence[str]) -> Callable[[Array], None]:
        """Return a function that lets real inputs change linearly over the next step, given their slopes.

        Parameters
        ----------
        names : sequence of str

        Returns
        -------
        callable
            Takes an array of shape (n,) in the FMU's units per second; UserError if the FMU refuses.
        """
        count = len(names)
        references = (ctypes.c_uint * count)(
            *(self.variable(name).valueReference for name in names)
        )
        orders, slopes = (ctypes.c_int * count)(*[1] * count), (ctypes.c_double * count)()
        types = (
            ctypes.c_uint * count,
            ctypes.c_size_t,
            ctypes.c_int * count,
            ctypes.c_double * count,
        )
        call = noted(
            bind(self._slave.dll, "fmi2SetRealInputDerivatives", *types),
            self.label,
            "setting slopes",
        )

        def write(row: Array) -> None:
            slopes[:] = row.tolist()
            status = call(self._slave.component, references, count, orders, slopes)
            if status > fmi2.fmi2Warning:
                raise self.failed(f"setting the slopes of {', '.join(names)}", status)
            self.warnings += status

        return write

    def _transfers(self, verb: str, names: Sequence[str]) -> list[Transfer]:
        moves = transfers(
            self._slave.dll, verb, names, {name: self.variable(name) for name in names}
        )
        what = f"{'setting' if verb == 'Set' else 'reading'} {', '.join(names)}"
        return [move._replace(call=noted(move.call, self.label, what)) for move in moves]
