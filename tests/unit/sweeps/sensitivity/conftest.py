"""A folder with an FMU of one state, for the command line."""

import pytest

from tests.support.hosts import build_one_state_fmu


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sensitivity")
    build_one_state_fmu(folder)
    return folder
