"""Rigs of the actuator, and the bench with both members: signals, units and hard limits.

Commands may step: the thesis drives its actuators with square waves of current around zero, and
with discrete weights. A length may not, for a step of length is an impact; the coil travels its
stroke in some 0.1 s.
"""

from __future__ import annotations

from ..kit.registry import RigDeclaration

_STROKE = 12.7e-3  # m, all of the voice coil's, wherever in it the zero is (thesis section 2.2.2)
_COIL_FORCE = 4.9  # N, that the voice coil bears continuously (thesis section 2.2.2)
_CURRENT = (-1.3, 1.3)
_FORCE = (0.0, 3.0)
_VOLTAGE = (-15.0, 15.0)  # compliance of the galvanostat (thesis table 2-2)
_TENSION = (-1.0, _COIL_FORCE)
_POSITION = (-_STROKE, _STROKE)
_DISPLACEMENTS = {"electrochemical_displacement": "m", "mechanical_displacement": "m"}

FORCE_DRIVEN = RigDeclaration(  # signals of ppy_actuator
    inputs={"current": "A", "force": "N"},
    outputs={"voltage": "V", "displacement": "m", **_DISPLACEMENTS, "charge": "C"},
    limits={
        "current": _CURRENT,
        "force": _FORCE,
        "voltage": _VOLTAGE,
        "displacement": _POSITION,
    },
)
LENGTH_DRIVEN = RigDeclaration(  # signals of ppy_actuator_length_driven
    inputs={"current": "A", "length_change": "m"},
    outputs={"tension": "N", "voltage": "V", **_DISPLACEMENTS, "charge": "C"},
    limits={
        "current": _CURRENT,
        "length_change": (*_POSITION, 0.1),
        "tension": _TENSION,
        "voltage": _VOLTAGE,
    },
)
BENCH = RigDeclaration(  # inputs of the system dma_bench, and outputs of both its members
    inputs={"force_reference": "N", "current": "A"},
    outputs={
        "position": "m",
        "velocity": "m/s",
        "coil_current": "A",
        "coil_voltage": "V",
        "force_measured": "N",
        "position_measured": "m",
        "tension": "N",
        "voltage": "V",
        **_DISPLACEMENTS,
        "charge": "C",
    },
    limits={
        "force_reference": _FORCE,
        "current": _CURRENT,
        "position": _POSITION,
        "force_measured": _TENSION,
        "position_measured": _POSITION,
        "tension": _TENSION,
        "voltage": _VOLTAGE,
    },
)
RIGS = {"force-driven": FORCE_DRIVEN, "length-driven": LENGTH_DRIVEN, "bench": BENCH}
