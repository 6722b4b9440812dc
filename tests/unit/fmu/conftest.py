"""Fixtures of the tests of single FMUs."""

from __future__ import annotations

import pytest

from fmus.kit.build.building import build
from fmus.kit.build.toolchain import host_platform
from tests.support.kit_samples import Thermostat


@pytest.fixture
def thermostat(tmp_path, runtime):
    """An FMU with parameters, inputs and outputs of every type."""
    path = tmp_path / "thermostat.fmu"
    path.write_bytes(build(Thermostat, runtime, [host_platform()]))
    return path
