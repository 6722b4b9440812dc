"""Fixtures of the tests of the master: its members, and a chain of two masses."""

from __future__ import annotations

import pytest

from tests.support.master.chain import two_masses
from tests.support.master.samples import build_member


@pytest.fixture(scope="module")
def members(tmp_path_factory):
    """FMUs by what they can do: ``members(dependencies=None, canInterpolateInputs=True, ...)``."""

    def path(**abilities):
        return build_member(tmp_path_factory.mktemp("member"), **abilities)

    return path


@pytest.fixture(scope="module")
def member(members):
    return members()


@pytest.fixture(scope="module")
def chain(tmp_path_factory):
    return two_masses(tmp_path_factory.mktemp("chain"), "native")
