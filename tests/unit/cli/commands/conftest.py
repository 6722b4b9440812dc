"""A record that several commands read."""

import pytest

from demonstrations.emulator.emulator import EmulatedRig
from demonstrations.emulator.physics import RigParameters
from tests.support.command import measure


@pytest.fixture
def record(tmp_path):
    return measure(tmp_path / "record.csv", EmulatedRig(RigParameters(R1=0.6, C=2.0), seed=1))
