"""An FMU of one lag, whose equations nobody knows."""

from __future__ import annotations

import pytest

import orchestration as ppy
from tests.support.hosts import build_one_state_fmu


@pytest.fixture(scope="session")
def lag(tmp_path_factory):
    folder = tmp_path_factory.mktemp("foreign")
    return ppy.find_model(str(build_one_state_fmu(folder)))
