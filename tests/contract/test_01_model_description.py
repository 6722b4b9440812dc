"""Line 1: the model description is valid, and its structure is what the FMU really does."""

from __future__ import annotations

import pytest
from fmpy.validation import validate_fmu

from tests.contract import structure
from tests.contract.models import Oscillator, Sampler
from tests.contract.subjects import each_component


def test_fmpy_finds_no_problem(archive):
    assert validate_fmu(str(archive)) == []


@pytest.mark.parametrize("cls", [Sampler, Oscillator])
def test_fmpy_finds_no_problem_in_other_models(built, cls, runtime):
    assert validate_fmu(str(built(cls, runtime))) == []


@each_component
def test_dependencies_are_those_found_by_differences_through_the_fmu(archive):
    structure.dependencies_are_those_found_by_differences(archive)


def test_every_output_derivative_and_initial_unknown_is_listed(archive):
    structure.every_unknown_is_listed(archive)
