"""Fixtures of the tests of SSP: a system with everything that one can have, and its file."""

from __future__ import annotations

from dataclasses import replace

import pytest

from orchestration.system import Connection, Member, Port, System, connect, ssp
from tests.support.system.samples import pair


@pytest.fixture
def system(tmp_path):
    """Everything that a system can have: all types, a factor with an offset, an input that feeds
    two members.
    """
    drive, load = pair(tmp_path / "fmus")
    other = Member("second load", load.fmu, {"level": 1.0, "hold": 0.0, "warm": 3.0, "odd": 2.0})
    wires = (
        *connect("drive.force -> load.force", "drive.force -> second load.force"),
        Connection(Port("drive", "way"), Port("second load", "length"), 1000.0, -0.1),
    )
    drive = replace(drive, parameters={"gain": 0.1, "steps": -3.0, "armed": 1.0})
    warm = replace(load, parameters={k: v for k, v in load.parameters.items() if k != "warm"})
    second = replace(other, parameters={k: v for k, v in other.parameters.items() if k != "warm"})
    inputs = {
        "command": (Port("drive", "command"),),
        "room": (Port("load", "warm"), Port("second load", "warm")),
        "nothing": (),
    }
    outputs = {"pull": Port("load", "tension"), "tension": Port("second load", "tension")}
    return System(
        "sample", (drive, warm, second), wires, inputs, outputs, 'a "doc" & <more>', 0.1 + 0.2, 1e-3
    )


@pytest.fixture
def archive(system, tmp_path):
    """The system as a file."""
    ssp.write(system, tmp_path / "sample.ssp")
    return tmp_path / "sample.ssp"
