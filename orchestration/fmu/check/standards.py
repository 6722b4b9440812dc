"""Requirements on an FMU's archive and binaries by the version of FMI."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple


class Platform(NamedTuple):
    """A platform of binaries.

    Attributes
    ----------
    format : {"ELF", "PE", "Mach-O"}
    machine : str
        Name of the processor in `read_library`; empty for one that it does not know.
    extension : str
        File extension of shared libraries, with the dot.
    """

    format: str
    machine: str
    extension: str


@dataclass(frozen=True)
class Standard:
    """Functions, platforms and file names of a version of FMI.

    Attributes
    ----------
    version : str
    functions : Mapping of str to str
        Functions that a binary must export, by interface, without their prefix.
    prefix : str
        Prefix of the functions, such as ``fmi2``.
    expected : tuple of str
        Common platforms, without one of which there is a note.
    token : str
        Attribute of the model description that identifies the FMU.
    icons : frozenset of str
        Allowed names of the icon.
    """

    version: str
    functions: Mapping[str, str]
    prefix: str
    expected: tuple[str, ...]
    token: str
    icons: frozenset[str]

    def required_functions(self, interface: str) -> set[str]:
        """Return the names of the functions that a binary must export for an interface."""
        return {self.prefix + name for name in self.functions[interface].split()}

    def platform(self, folder: str) -> Platform | None:
        """Return the platform of a folder in ``binaries/``; None if it is not in the standard."""
        if self.version == "2.0" and folder in _PLATFORMS:
            return _PLATFORMS[folder]
        # a platform tuple of FMI 3.0, which FMI 2.0.4 uses for other processors
        match = _TUPLE.fullmatch(folder)
        if match is None or (self.version == "2.0" and folder != "aarch64-linux"):
            return None
        file_format, extension = _SYSTEMS[match["system"]]
        return Platform(file_format, _MACHINES.get(match["machine"], ""), extension)


_SYSTEMS = {"linux": ("ELF", ".so"), "windows": ("PE", ".dll"), "darwin": ("Mach-O", ".dylib")}
_MACHINES = {"x86": "x86", "x86_64": "x86_64", "aarch64": "arm64"}
_TUPLE = re.compile(
    r"(?P<machine>aarch32|aarch64|riscv32|riscv64|x86|x86_64|ppc32|ppc64)"
    r"-(?P<system>linux|windows|darwin)(-\w+)?"
)
_PLATFORMS = {
    "linux32": Platform("ELF", "x86", ".so"),
    "linux64": Platform("ELF", "x86_64", ".so"),
    "win32": Platform("PE", "x86", ".dll"),
    "win64": Platform("PE", "x86_64", ".dll"),
    "darwin32": Platform("Mach-O", "x86", ".dylib"),
    "darwin64": Platform("Mach-O", "x86_64", ".dylib"),
}

_COMMON_2 = (
    "GetTypesPlatform GetVersion SetDebugLogging Instantiate FreeInstance SetupExperiment"
    " EnterInitializationMode ExitInitializationMode Terminate Reset GetReal GetInteger GetBoolean"
    " GetString SetReal SetInteger SetBoolean SetString GetFMUstate SetFMUstate FreeFMUstate"
    " SerializedFMUstateSize SerializeFMUstate DeSerializeFMUstate GetDirectionalDerivative"
)
_TYPES_3 = (
    "Float32 Float64 Int8 UInt8 Int16 UInt16 Int32 UInt32 Int64 UInt64 Boolean String Binary Clock"
)
_COMMON_3 = (
    "GetVersion SetDebugLogging FreeInstance EnterInitializationMode ExitInitializationMode"
    " EnterEventMode Terminate Reset GetNumberOfVariableDependencies GetVariableDependencies"
    " GetFMUState SetFMUState FreeFMUState SerializedFMUStateSize SerializeFMUState"
    " DeserializeFMUState GetDirectionalDerivative GetAdjointDerivative EnterConfigurationMode"
    " ExitConfigurationMode GetIntervalDecimal GetIntervalFraction GetShiftDecimal"
    " GetShiftFraction SetIntervalDecimal SetIntervalFraction SetShiftDecimal SetShiftFraction"
    " EvaluateDiscreteStates UpdateDiscreteStates "
) + " ".join(f"{verb}{kind}" for kind in _TYPES_3.split() for verb in ("Get", "Set"))

STANDARDS = {
    2: Standard(
        version="2.0",
        functions={
            "CoSimulation": (
                f"{_COMMON_2} SetRealInputDerivatives GetRealOutputDerivatives DoStep CancelStep"
                " GetStatus GetRealStatus GetIntegerStatus GetBooleanStatus GetStringStatus"
            ),
            "ModelExchange": (
                f"{_COMMON_2} EnterEventMode NewDiscreteStates EnterContinuousTimeMode"
                " CompletedIntegratorStep SetTime SetContinuousStates GetDerivatives"
                " GetEventIndicators GetContinuousStates GetNominalsOfContinuousStates"
            ),
        },
        prefix="fmi2",
        expected=("linux64", "win64", "darwin64"),
        token="guid",
        icons=frozenset({"model.png"}),
    ),
    3: Standard(
        version="3.0",
        functions={
            "CoSimulation": (
                f"{_COMMON_3} InstantiateCoSimulation EnterStepMode GetOutputDerivatives DoStep"
            ),
            "ModelExchange": (
                f"{_COMMON_3} InstantiateModelExchange EnterContinuousTimeMode"
                " CompletedIntegratorStep SetTime SetContinuousStates"
                " GetContinuousStateDerivatives GetEventIndicators GetContinuousStates"
                " GetNominalsOfContinuousStates GetNumberOfEventIndicators"
                " GetNumberOfContinuousStates"
            ),
            "ScheduledExecution": (
                f"{_COMMON_3} InstantiateScheduledExecution ActivateModelPartition"
            ),
        },
        prefix="fmi3",
        expected=("x86_64-linux", "x86_64-windows", "aarch64-darwin"),
        token="instantiationToken",
        icons=frozenset({"terminalsAndIcons/icon.png", "terminalsAndIcons/icon.svg"}),
    ),
}
