"""Claims: data are cut at samples, and what cannot be identified from is refused in one line."""

import numpy as np
import pytest

from fmus.kit.errors import UserError
from orchestration.identify.black_box import arx, input_output_data, state_space
from orchestration.identify.black_box.data import input_index
from tests.support.black_box import box_jenkins_record


def changed(column=None, row=None, value=None, **more):
    record = box_jenkins_record(0, 100)
    u, y = record.inputs.copy(), record.output.copy()
    if column == "output":
        y[slice(None) if row is None else row] = value
    elif column is not None:
        u[slice(None) if row is None else row, column] = value
    return input_output_data(
        u, y, more.pop("step", 1.0), ["force", "current"], more.pop("name", "displacement")
    )


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (
            lambda: changed(1, 17, np.nan),
            r"^input current, sample 17: is nan, must be a finite number; fill gaps",
        ),
        (
            lambda: changed("output", 3, np.inf),
            r"^output displacement, sample 3: is inf, must be a finite number",
        ),
        (
            lambda: arx(changed(0, None, 0.25), 1, 1),
            r"^input force is constant \(0\.25 in all 100 samples\): an",
        ),
        (
            lambda: state_space(changed(0, None, 2), 1),
            r"^input force is constant \(2 in all 100 samples\)",
        ),
        (
            lambda: arx(changed("output", None, 1), 1, 1),
            r"^output displacement is constant \(1 in all 100 samples\)$",
        ),
        (lambda: changed(step=0.0), r"^step = 0 s: must be a finite number above 0$"),
        (lambda: changed(name="force"), r"^force is an input and the output: name it once$"),
        (
            lambda: input_output_data([1.0, 2.0], [1.0], 1.0),
            r"^inputs have shape \(2,\) and the output \(1,\)",
        ),
        (lambda: input_output_data(["a"], [1.0], 1.0), r"^inputs: must be an array of numbers"),
    ],
)
def test_bad_data_are_told_in_one_line(make, said):
    with pytest.raises(UserError, match=said) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_parts_are_those_of_the_samples_and_two_of_them_are_the_whole():
    whole = input_output_data(np.arange(20.0).reshape(10, 2), np.arange(10.0), 0.5)
    first, rest = whole.split(0.3)
    assert (len(first), len(rest)) == (3, 7)
    assert rest.output.tolist() == list(range(3, 10))
    assert rest.inputs[0].tolist() == [6.0, 7.0]
    assert whole.part(8).output.tolist() == [8.0, 9.0]
    assert (first.step, first.input_names) == (0.5, ("u1", "u2"))


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (
            lambda: changed().part(300),
            r"^part from sample 300 to None: there are none, of 100 samples$",
        ),
        (lambda: changed().split(1.0), r"^share = 1: must be between 0 and 1, neither of them$"),
        (
            lambda: changed().split(0.001),
            r"^share = 0\.001 of 100 samples: both parts need samples$",
        ),
        (lambda: input_index(["force"], 1), r"^input 1: must be from 0 to 0$"),
        (
            lambda: input_index(["force"], "foce"),
            r"^input foce: there is none \(did you mean force",
        ),
    ],
)
def test_parts_and_inputs_that_there_are_not_are_told(make, said):
    with pytest.raises(UserError, match=said):
        make()
