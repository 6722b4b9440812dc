"""The bare C functions of an FMU of FMI 3.0 under the names and arguments of FMI 2.0.

What is tested of both versions is written once; a call goes to one function of FMI 3.0, but for
``fmi2SetupExperiment``, whose arguments are those of ``fmi3EnterInitializationMode``.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from ctypes import byref, c_bool, c_char_p, c_double, c_int, c_size_t, c_void_p
from typing import Any

OK = 0
_Logger = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)
_KINDS = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean", "String": "String"}
TYPES = {new: old for old, new in _KINDS.items()}
# functions of one form in both versions
_SAME = {
    "fmi2ExitInitializationMode": ("ExitInitializationMode", []),
    "fmi2Terminate": ("Terminate", []),
    "fmi2Reset": ("Reset", []),
    "fmi2GetFMUstate": ("GetFMUState", [c_void_p]),
    "fmi2SetFMUstate": ("SetFMUState", [c_void_p]),
    "fmi2FreeFMUstate": ("FreeFMUState", [c_void_p]),
    "fmi2SerializedFMUstateSize": ("SerializedFMUStateSize", [c_void_p, c_void_p]),
    "fmi2SerializeFMUstate": ("SerializeFMUState", [c_void_p, c_void_p, c_size_t]),
    "fmi2DeSerializeFMUstate": ("DeserializeFMUState", [c_void_p, c_size_t, c_void_p]),
}


class Fmi3Functions:
    """Functions of a library of FMI 3.0 by their names in FMI 2.0.

    Parameters
    ----------
    library : ctypes.CDLL
    """

    def __init__(self, library: ctypes.CDLL):
        self._library = library
        self._loggers: dict[int | None, Any] = {}  # as long as instances may call them
        self._experiments: dict[int, tuple[Any, ...]] = {}
        for name, (new, arguments) in _SAME.items():
            setattr(self, name, self._function(new, arguments))
        for verb in ("Get", "Set"):
            for kind, new in _KINDS.items():
                setattr(self, f"fmi2{verb}{kind}", self._access(verb, new))

    def _function(self, name: str, arguments: list[Any]) -> Any:
        function = getattr(self._library, f"fmi3{name}")
        function.argtypes = [c_void_p, *arguments]
        return function

    def _access(self, verb: str, kind: str) -> Callable[[int, Any, int, Any], int]:
        """Return a function that reads or writes ``n`` scalars."""
        function = self._function(f"{verb}{kind}", [c_void_p, c_size_t, c_void_p, c_size_t])
        if kind != "Boolean":
            return lambda c, vr, n, values: function(c, vr, n, values, n)

        def access(c: int, vr: Any, n: int, values: Any) -> int:
            cells = (c_bool * n)(*values)
            status: int = function(c, vr, n, cells, n)
            values[:] = list(map(int, cells))
            return status

        return access

    def fmi2Instantiate(
        self,
        name: bytes,
        kind: int,
        guid: bytes,
        resources: bytes,
        callbacks: Any,
        visible: int,
        logging: int,
    ) -> int | None:
        """Make an instance for co-simulation without event mode."""

        def log(environment: Any, status: int, category: bytes, message: bytes) -> None:
            callbacks._obj.logger(environment, name, status, category, message)

        logger = _Logger(log)
        make = self._library.fmi3InstantiateCoSimulation
        make.argtypes = [
            *(c_char_p, c_char_p, c_char_p, c_bool, c_bool, c_bool, c_bool),
            *(c_void_p, c_size_t, c_void_p, _Logger, c_void_p),
        ]
        make.restype = c_void_p
        modes = (False, bool(logging), False, False)
        made: int | None = make(name, guid, resources, *modes, None, 0, None, logger, None)
        self._loggers[made] = logger
        return made

    def fmi2FreeInstance(self, c: int) -> None:
        """Free an instance."""
        self._function("FreeInstance", [])(c)
        self._loggers.pop(c, None)
        self._experiments.pop(c, None)

    def fmi2SetupExperiment(self, c: int, *experiment: Any) -> int:
        """Keep the experiment for the next call."""
        self._experiments[c] = experiment
        return OK

    def fmi2EnterInitializationMode(self, c: int) -> int:
        """Begin initialization with the experiment that was kept."""
        types = [c_bool, c_double, c_double, c_bool, c_double]
        status: int = self._function("EnterInitializationMode", types)(c, *self._experiments[c])
        return status

    def fmi2DoStep(self, c: int, time: float, size: float, no_set_state: int) -> int:
        """Make a step, which never ends early."""
        event, terminate, early, last = c_bool(), c_bool(), c_bool(), c_double()
        step = self._function("DoStep", [c_double, c_double, c_bool, *[c_void_p] * 4])
        status: int = step(
            *(c, time, size, bool(no_set_state)),
            *map(byref, (event, terminate, early, last)),
        )
        asked = [wish.value for wish in (event, terminate, early)]
        assert asked == [False, False, False]
        return status
