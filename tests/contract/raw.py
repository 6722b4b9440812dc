"""An FMU through its bare C functions: it returns every status and keeps every message.

Any argument can be passed. fmpy turns a status into an exception and checks some arguments itself;
here nothing stands between a test and the FMU. Imports are few, so that a process of its own starts
fast.
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import functools
import gc
import math
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from tests.contract.raw3 import TYPES, Fmi3Functions

OK, WARNING, DISCARD, ERROR, FATAL = range(5)
BINARY = {"linux": ("linux64", ".so"), "win32": ("win64", ".dll"), "darwin": ("darwin64", ".dylib")}

_Logger = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)


class _Callbacks(ctypes.Structure):
    _fields_ = [
        ("logger", _Logger),
        ("allocateMemory", c_void_p),
        ("freeMemory", c_void_p),
        ("stepFinished", c_void_p),
        ("componentEnvironment", c_void_p),
    ]


_EXCHANGE: dict[str, list[Any]] = {
    "fmi2EnterEventMode": [],
    "fmi2EnterContinuousTimeMode": [],
    "fmi2NewDiscreteStates": [c_void_p],
    "fmi2CompletedIntegratorStep": [c_int, c_void_p, c_void_p],
    "fmi2SetTime": [c_double],
    **{
        f"fmi2{name}": [c_void_p, c_size_t]
        for name in (
            "SetContinuousStates",
            "GetContinuousStates",
            "GetNominalsOfContinuousStates",
            "GetDerivatives",
            "GetEventIndicators",
        )
    },
}
_SIGNATURES: dict[str, list[Any]] = {
    "fmi2SetDebugLogging": [c_int, c_size_t, c_void_p],
    "fmi2SetupExperiment": [c_int, c_double, c_double, c_int, c_double],
    "fmi2EnterInitializationMode": [],
    "fmi2ExitInitializationMode": [],
    "fmi2Terminate": [],
    "fmi2Reset": [],
    "fmi2DoStep": [c_double, c_double, c_int],
    "fmi2CancelStep": [],
    "fmi2GetDirectionalDerivative": [c_void_p, c_size_t, c_void_p, c_size_t, c_void_p, c_void_p],
    "fmi2SetRealInputDerivatives": [c_void_p, c_size_t, c_void_p, c_void_p],
    "fmi2GetRealOutputDerivatives": [c_void_p, c_size_t, c_void_p, c_void_p],
    "fmi2GetFMUstate": [c_void_p],
    "fmi2SetFMUstate": [c_void_p],
    "fmi2FreeFMUstate": [c_void_p],
    "fmi2SerializedFMUstateSize": [c_void_p, c_void_p],
    "fmi2SerializeFMUstate": [c_void_p, c_void_p, c_size_t],
    "fmi2DeSerializeFMUstate": [c_void_p, c_size_t, c_void_p],
    **{
        f"fmi2{verb}{kind}": [c_void_p, c_size_t, c_void_p]
        for verb in ("Get", "Set")
        for kind in ("Real", "Integer", "Boolean", "String")
    },
    **{
        f"fmi2Get{kind}Status": [c_int, c_void_p]
        for kind in ("", "Real", "Integer", "Boolean", "String")
    },
}


@contextlib.contextmanager
def unzipped(fmu: str | Path) -> Iterator[Path]:
    """Folder with the contents of an FMU, removed afterwards."""
    with tempfile.TemporaryDirectory(prefix="contract_") as folder:
        with zipfile.ZipFile(fmu) as archive:
            archive.extractall(folder)
        yield Path(folder)


class Library:
    """The binary of an unzipped FMU, and what its model description says.

    Attributes
    ----------
    variables : dict of str to tuple
        Name to value reference and FMI type.
    causality, variability : dict of str to str
        By name.
    step : float
        Communication step that the model description proposes, in seconds.
    """

    def __init__(self, folder: Path):
        self.folder = folder
        description = ElementTree.parse(folder / "modelDescription.xml").getroot()
        self.fmi = int(description.attrib["fmiVersion"][0])
        self.guid = description.attrib["guid" if self.fmi == 2 else "instantiationToken"]
        variables = {v.attrib["name"]: v for v in description.find("ModelVariables") or ()}
        self.variables = {
            name: (int(v.attrib["valueReference"]), v[0].tag if self.fmi == 2 else TYPES[v.tag])
            for name, v in variables.items()
        }
        self.causality = {name: v.attrib["causality"] for name, v in variables.items()}
        self.variability = {name: v.attrib["variability"] for name, v in variables.items()}
        self.step = float(description.find("DefaultExperiment").attrib["stepSize"])  # type: ignore[union-attr]
        identifier = description.find("CoSimulation").attrib["modelIdentifier"]  # type: ignore[union-attr]
        platform, extension = BINARY[sys.platform]
        file = identifier + extension
        if self.fmi == 3:
            (path,) = (folder / "binaries").glob(f"*/{file}")
            self.dll: Any = Fmi3Functions(ctypes.CDLL(str(path)))
            return
        self.dll = ctypes.CDLL(str(folder / "binaries" / platform / file))
        self.dll.fmi2Instantiate.argtypes = [
            c_char_p,
            c_int,
            c_char_p,
            c_char_p,
            c_void_p,
            c_int,
            c_int,
        ]
        self.dll.fmi2Instantiate.restype = c_void_p
        self.dll.fmi2FreeInstance.argtypes = [c_void_p]
        self.dll.fmi2FreeInstance.restype = None
        exchanges = description.find("ModelExchange") is not None
        for name, arguments in (_SIGNATURES | (_EXCHANGE if exchanges else {})).items():
            getattr(self.dll, name).argtypes = [c_void_p, *arguments]

    @property
    def resources(self) -> bytes:
        place = self.folder / "resources"
        return (place.as_uri() if self.fmi == 2 else f"{place}/").encode()


class Instance:
    """One instance, with its logger; freed by :meth:`free` or as a context manager.

    Attributes
    ----------
    component : int or None
        What ``fmi2Instantiate`` returned.
    messages : list of str
        Texts of what was logged with a status beyond OK.
    levels : list of int
        Their statuses.
    """

    def __init__(self, library: Library, name: bytes | None = b"instance", **replaced: Any):
        self.library, self.dll, self.variables = library, library.dll, library.variables
        self.messages: list[str] = []
        self.levels: list[int] = []
        self.categories: list[str] = []
        self.time = 0.0
        self._callbacks = _Callbacks(logger=_Logger(self._log))
        self.callbacks = byref(self._callbacks)
        given = {
            "kind": 1,
            "guid": library.guid.encode(),
            "resources": library.resources,
            "logging": 0,
        }
        given |= {"callbacks": self.callbacks} | replaced
        self.component = self.dll.fmi2Instantiate(
            name,
            given["kind"],
            given["guid"],
            given["resources"],
            given["callbacks"],
            0,
            given["logging"],
        )

    def _log(
        self, environment: Any, name: bytes, status: int, category: bytes, message: bytes
    ) -> None:
        self.messages.append(message.decode().replace("%%", "%"))
        self.levels.append(status)
        self.categories.append(category.decode())

    def __enter__(self) -> Instance:
        return self

    def __exit__(self, *error: object) -> None:
        self.free()

    def free(self) -> None:
        if self.component is not None:
            self.dll.fmi2FreeInstance(self.component)
            self.component = None

    def call(self, function: str, *arguments: Any) -> int:
        """Status of an FMI function called with just these arguments."""
        return getattr(self.dll, function)(self.component, *arguments)

    # --- what should succeed: any other status is a failed assertion with the FMU's message
    # --------------------------

    def do(self, function: str, *arguments: Any) -> None:
        status = self.call(function, *arguments)
        assert status == OK, f"{function} returned {status}: {self.messages}"

    def initialize(
        self, parameters: Mapping[str, float] | None = None, start: float = 0.0
    ) -> Instance:
        """Go through initialization; inputs may be among the parameters."""
        self.do("fmi2SetupExperiment", 0, 0.0, start, 0, 0.0)
        self.time = start
        self.set(parameters or {})
        self.do("fmi2EnterInitializationMode")
        self.do("fmi2ExitInitializationMode")
        return self

    def transfer(
        self, verb: str, names: Sequence[str], values: Sequence[float] | None = None
    ) -> list[float]:
        """Set or get variables, those of one type by one call; what they hold afterwards."""
        places: dict[str, list[int]] = {}
        for place, name in enumerate(names):
            places.setdefault(self.variables[name][1], []).append(place)
        result = [0.0] * len(names)
        for kind, members in places.items():
            n = len(members)
            references = (c_uint * n)(*(self.variables[names[place]][0] for place in members))
            cells = (c_double * n)() if kind == "Real" else (c_int * n)()
            if values is not None:
                given = (values[place] for place in members)
                cells[:] = [*given] if kind == "Real" else [int(value) for value in given]
            self.do(f"fmi2{verb}{kind}", references, n, cells)
            for place, value in zip(members, cells, strict=True):
                result[place] = value
        return result

    def set(self, values: Mapping[str, float]) -> None:
        self.transfer("Set", list(values), list(values.values()))

    def get(self, *names: str) -> list[float]:
        return self.transfer("Get", names)

    def everything(self) -> list[float]:
        """Value of every variable."""
        return self.get(*self.variables)

    def step(self, size: float) -> None:
        self.do("fmi2DoStep", self.time, size, 1)
        self.time += size

    def save(self) -> c_void_p:
        state = c_void_p()
        self.do("fmi2GetFMUstate", byref(state))
        return state

    def restore(self, state: c_void_p) -> None:
        self.do("fmi2SetFMUstate", state)

    def forget(self, state: c_void_p) -> None:
        self.do("fmi2FreeFMUstate", byref(state))

    def serialize(self, state: c_void_p) -> bytes:
        size = c_size_t()
        self.do("fmi2SerializedFMUstateSize", state, byref(size))
        block = ctypes.create_string_buffer(size.value)
        self.do("fmi2SerializeFMUstate", state, block, size)
        return block.raw

    def deserialize(self, block: bytes) -> c_void_p:
        state = c_void_p()
        self.do("fmi2DeSerializeFMUstate", block, len(block), byref(state))
        return state

    def tangent(
        self, unknowns: Sequence[str], knowns: Sequence[str], seeds: Sequence[float]
    ) -> list[float]:
        result = (c_double * len(unknowns))()
        self.do(
            "fmi2GetDirectionalDerivative",
            self.references(unknowns),
            len(unknowns),
            self.references(knowns),
            len(knowns),
            doubles(*seeds),
            result,
        )
        return list(result)

    def references(self, names: Sequence[str]) -> Any:
        return references(*(self.variables[name][0] for name in names))


def references(*numbers: int) -> Any:
    return (c_uint * len(numbers))(*numbers)


def doubles(*numbers: float) -> Any:
    return (c_double * len(numbers))(*numbers)


def integers(*numbers: int) -> Any:
    return (c_int * len(numbers))(*numbers)


@functools.cache
def _library(fmu: str | Path, changed: int, size: int) -> Library:
    """Library of an FMU file, unzipped until this process ends.

    The arguments `changed` (time of change of the file, ns) and `size` (bytes) tell one file from
    another that takes its place.
    """
    kept = contextlib.ExitStack()
    atexit.register(kept.close)
    return Library(kept.enter_context(unzipped(fmu)))


@contextlib.contextmanager
def instance(fmu: str | Path, **given: Any) -> Iterator[Instance]:
    """One instance of an FMU file, whose library is loaded once into this process."""
    about = Path(fmu).stat()
    library = _library(fmu, about.st_mtime_ns, about.st_size)
    with Instance(library, **given) as one:
        assert one.component is not None, one.messages
        yield one


def resident() -> int:
    """Resident memory of this process in bytes; Linux only."""
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


class _Mallinfo(ctypes.Structure):
    """``struct mallinfo2`` of glibc."""

    _names = "arena ordblks smblks hblks hblkhd usmblks fsmblks uordblks fordblks keepcost"
    _fields_ = [(name, c_size_t) for name in _names.split()]


def allocated() -> int:
    """Bytes that are allocated, by C to the byte, by Python at least; glibc only."""
    gc.collect()
    ask = ctypes.CDLL(None).mallinfo2
    ask.restype = _Mallinfo
    info = ask()
    return (
        int(info.uordblks + info.hblkhd) + 16 * sys.getallocatedblocks()
    )  # the smallest block of Python


def fast_stepper(
    one: Instance, name: str, value: float, output: str
) -> Callable[[int, float], None]:
    """Return a function that makes many set-step-get cycles, with nothing allocated in between."""
    component, dll = one.component, one.dll
    fed, read, cell = one.references([name]), one.references([output]), doubles(value)
    answer = doubles(math.nan)
    set_real, step, get_real = dll.fmi2SetReal, dll.fmi2DoStep, dll.fmi2GetReal

    def run(count: int, size: float) -> None:
        worst, time = OK, one.time
        for _ in range(count):
            worst = max(
                worst,
                set_real(component, fed, 1, cell)
                | step(component, time, size, 1)
                | get_real(component, read, 1, answer),
            )
            time += size
        one.time = time
        assert worst == OK, one.messages
        assert math.isfinite(answer[0])

    return run
