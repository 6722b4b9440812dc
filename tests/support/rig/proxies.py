"""The proxies as FMUs, both builds, through their bare C functions, at a small rig of the test's
own.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from typing import Any

import pytest

from tests.contract.raw import OK, Instance, references
from tests.support.rig.small_rig import INPUTS, SmallRig

OUTPUTS = {
    "voltage": "V",
    "displacement": "m",
    "electrochemical_displacement": "m",
    "mechanical_displacement": "m",
    "charge": "C",
}


def plant(inputs: Mapping[str, float], now: float) -> dict[str, float]:
    """An actuator that answers at once; its charge shows when the sample was taken."""
    strain, load = 2e-5 * inputs["current"], 1e-4 * inputs["force"]
    return {
        "voltage": 0.6 * inputs["current"],
        "displacement": strain + load,
        "electrochemical_displacement": strain,
        "mechanical_displacement": load,
        "charge": now,
    }


def actuator_rig(**about: Any) -> SmallRig:
    """A rig that rig_proxy fits to."""
    return SmallRig(
        **({"plant": plant, "inputs": INPUTS, "outputs": OUTPUTS, "limits": {}} | about)
    )


def set_text(one: Instance, name: str, text: str | bytes | None) -> int:
    """Status of setting a text."""
    value = text.encode() if isinstance(text, str) else text
    cell = (ctypes.c_char_p * 1)(value)
    return one.call("fmi2SetString", references(one.variables[name][0]), 1, cell)


def get_text(one: Instance, name: str) -> str:
    """Read a text."""
    cell = (ctypes.c_char_p * 1)()
    one.do("fmi2GetString", references(one.variables[name][0]), 1, cell)
    return (cell[0] or b"").decode()


def connected(
    one: Instance, rig: SmallRig, values: Mapping[str, float] | None = None, **texts: str
) -> Instance:
    """Initialize an instance at a rig."""
    for name, text in ({"endpoint": rig.endpoint} | texts).items():
        assert set_text(one, name, text) == OK, one.messages
    return one.initialize(values)


def answered(one: Instance, **outputs: float) -> None:
    """Step on until outputs show what a command makes of them; a loaded machine takes more than one
    step for it.
    """
    for _ in range(100):
        one.step(0.05)
        if one.get(*outputs) == pytest.approx(list(outputs.values())):
            return
    raise AssertionError(f"{one.get(*outputs)} after a hundred steps, not {outputs}")
