"""Claims: a group of records has its local values in place of the common ones, under its name."""

from __future__ import annotations

import pytest

from orchestration.diagnosis.local_values import COMMON, LocalValues, columns

NAMES = ["mass", "stiffness", "damping"]
THREE = LocalValues(("a", "b", "c"), each=("stiffness",), later=("mass",), later_values=((1,),))


@pytest.mark.parametrize(("group", "places"), [(0, [0, 1, 2]), (1, [0, 3, 2]), (2, [5, 4, 2])])
def test_copies_stand_behind_the_common_values(group, places):
    assert columns(3, THREE.of_parameters(NAMES), group).tolist() == places


def test_a_value_of_a_term_differs_in_the_last_group_alone():
    assert [columns(2, THREE.of_terms(), group).tolist() for group in range(3)] == [
        [0, 1],
        [0, 1],
        [0, 2],
    ]
    assert (THREE.changes, THREE.released) == (2, 2)
    assert LocalValues(("a", "b"), later_values=((0, 1), (2,))).changes == 2


def test_a_parameter_that_is_not_searched_has_no_copies():
    assert THREE.of_parameters(["damping"]) == []
    assert COMMON.of_parameters(NAMES) == []


def test_local_values_have_the_name_of_their_group():
    assert [THREE.name(name, 2) for name in NAMES] == ["mass@c", "stiffness@c", "damping"]
    assert LocalValues(("a",), each=("mass",)).name("mass", 0) == "mass"
