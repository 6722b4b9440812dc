"""Signals of a rig: their names, units and limits, and checks of values given for them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf

from fmus.kit.errors import UserError, suggestion

UNITS = {
    "current": "A",
    "force": "N",
    "length_change": "m",
    "force_reference": "N",
    "voltage": "V",
    "displacement": "m",
    "electrochemical_displacement": "m",
    "mechanical_displacement": "m",
    "charge": "C",
    "tension": "N",
    "position": "m",
    "velocity": "m/s",
    "coil_current": "A",
    "coil_voltage": "V",
    "force_measured": "N",
    "position_measured": "m",
}
"""SI unit of every signal that is known by name."""


@dataclass(frozen=True)
class Limit:
    """Hard limits of one signal, SI.

    Attributes
    ----------
    min, max : float
        Inclusive.
    rate : float
        Largest change per second.
    """

    min: float = -inf
    max: float = inf
    rate: float = inf


_STROKE = 12.7e-3  # m, all of the voice coil's, wherever in it the zero is (thesis section 2.2.2)
_COIL_FORCE = 4.9  # N, that the voice coil bears continuously (thesis section 2.2.2)
# Commands may step: the thesis drives its actuators with square waves of current around zero, and
# with discrete weights. A length may not, for a step of length is an impact; the coil travels its
# stroke in some 0.1 s.
KNOWN_LIMITS: Mapping[str, Limit] = {
    "current": Limit(-1.3, 1.3),
    "force": Limit(0.0, 3.0),
    "force_reference": Limit(0.0, 3.0),
    "length_change": Limit(-_STROKE, _STROKE, rate=0.1),
    "voltage": Limit(-15.0, 15.0),  # compliance of the galvanostat (thesis table 2-2)
    "displacement": Limit(-_STROKE, _STROKE),
    "tension": Limit(-1.0, _COIL_FORCE),
    "position": Limit(-_STROKE, _STROKE),
    "force_measured": Limit(-1.0, _COIL_FORCE),
    "position_measured": Limit(-_STROKE, _STROKE),
}
"""Limits of commands, and of measured values: beyond them the rig goes to its safe state."""


@dataclass(frozen=True)
class RigSignals:
    """Names of the inputs and outputs of a rig."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


_DISPLACEMENTS = ("electrochemical_displacement", "mechanical_displacement")
SIGNALS: Mapping[str, RigSignals] = {
    "force-driven": RigSignals(
        ("current", "force"), ("voltage", "displacement", *_DISPLACEMENTS, "charge")
    ),
    "length-driven": RigSignals(
        ("current", "length_change"), ("tension", "voltage", *_DISPLACEMENTS, "charge")
    ),
    "bench": RigSignals(
        ("force_reference", "current"),
        (
            "position",
            "velocity",
            "coil_current",
            "coil_voltage",
            "force_measured",
            "position_measured",
            "tension",
            "voltage",
            *_DISPLACEMENTS,
            "charge",
        ),
    ),
}
"""Signals of the rigs that are known by name.

The first two are those of ``ppy_actuator`` and ``ppy_actuator_length_driven``; the bench has the
inputs of ``dma_bench`` and the outputs of both its members.
"""


def one_of(option: str, value: str, allowed: Mapping[str, object] | tuple[str, ...]) -> str:
    """Return the value of an option that is one of those allowed.

    Raises
    ------
    UserError
        If it is not.
    """
    if value not in allowed:
        raise UserError(f"option {option} = {value!r}{suggestion(value, list(allowed))}")
    return value


def integer(option: str, value: str) -> int:
    """Return the value of an option that is a whole number of at least 0.

    Raises
    ------
    UserError
        If it is not.
    """
    if not (value.isascii() and value.isdigit() and len(value) < 19):
        raise UserError(f"option {option} = {value!r}: must be a whole number of at least 0")
    return int(value)


def seconds(option: str, value: str, most: float) -> float:
    """Return the value of an option that is a duration above zero, s.

    Raises
    ------
    UserError
        If it is not.
    """
    try:
        duration = float(value)
    except ValueError:
        duration = 0.0
    if not 0 < duration <= most:
        raise UserError(
            f"option {option} = {value!r}: must be a number of seconds above 0, at most {most:g}"
        )
    return duration


def commands(values: Mapping[str, float], inputs: Mapping[str, str]) -> dict[str, float]:
    """Return the commanded value of every input.

    Raises
    ------
    UserError
        If one is missing, is not known, or is not a finite number.
    """
    for name in values:
        if name not in inputs:
            raise UserError(
                f"command {name!r}: not an input of this rig{suggestion(name, list(inputs))}"
            )
    for name in inputs:
        value = values.get(name)
        if value is None or not abs(value) < inf:
            given = "missing" if value is None else value
            raise UserError(f"command {name} = {given}: must be a finite number")
    return {name: float(values[name]) for name in inputs}


def checked_step(step: float, most: float) -> float:
    """Return a step of time that a rig can take, s.

    Raises
    ------
    UserError
        If it is negative, not finite or longer than `most`.
    """
    if not 0 <= step <= most:
        raise UserError(f"step = {step} s: must be from 0 to {most:g} s")
    return float(step)
