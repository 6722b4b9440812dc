"""Fixtures that the tests of the functions in Python share."""

from __future__ import annotations

import pytest

from tests.support.hosts import build_one_state_fmu


@pytest.fixture(scope="session")
def lag(tmp_path_factory):
    """Return a foreign FMU: ``tau dx/dt = u - x`` from nothing, exact for inputs that are held."""
    return str(build_one_state_fmu(tmp_path_factory.mktemp("lag")))
