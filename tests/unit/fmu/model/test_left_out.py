"""Claims: of a variable that cannot be set by its name it is told why."""

import pytest

from fmus.kit import UserError
from orchestration.fmu import Archive, find_model
from orchestration.fmu.model.left_out import left_out
from tests.support.fmi3_fmus import changed, foreign
from tests.support.hosts import build_one_state_fmu


def reasons(path):
    with Archive(path) as archive:
        return left_out(archive.description)


def test_arrays_and_sizes_are():
    assert reasons(foreign("arrays")) == {
        "n": "is a structural parameter, which keeps its start value 3 here",
        **{
            name: f"is an array, whose elements have names of their own, such as {element}"
            for name, element in {
                "A": "A[1,1]",
                "B": "B[1,1]",
                "C": "C[1,1]",
                "u": "u[1]",
                "y": "y[1]",
            }.items()
        },
    }


def test_input_clocks_are(tmp_path):
    clock = (
        '<Clock name="c" valueReference="50" causality="input" intervalVariability="triggered"/>'
        '<Clock name="d" valueReference="51" causality="output" intervalVariability="triggered"/>'
        "</ModelVariables>"
    )
    path = changed("lag", tmp_path, "</ModelVariables>", clock)
    assert reasons(path) == {"c": "is an input clock, which has no value here"}


def test_nothing_is_in_an_fmu_of_fmi_2(tmp_path):
    assert reasons(build_one_state_fmu(tmp_path)) == {}


@pytest.mark.parametrize(
    ("name", "setting", "told"),
    [
        ("arrays", "n=2", "arrays.fmu: n is a structural parameter, which keeps its start value 3"),
        ("arrays", "A=2", "arrays.fmu: A is an array, whose elements .* such as A\\[1,1\\]"),
    ],
)
def test_setting_one_is_refused_with_the_reason(name, setting, told):
    with pytest.raises(UserError, match=told):
        find_model(str(foreign(name))).settings([setting])
