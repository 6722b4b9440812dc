"""Claims: a declaration describes a variable and leaves the class."""

import pickle

import pytest

from fmus.kit import Array, Component, Integrator, Parameter, UserError, stack
from fmus.kit.declare import Constant, OutputDeclaration, ParameterDeclaration, of_differences
from fmus.kit.units import difference_unit
from tests.support.kit_samples import Divider, Thermostat, Wall


def test_description_of_an_output_is_the_first_line_of_its_docstring():
    power, warm = Thermostat.layout.outputs
    assert power.doc == "Electric power. The second sentence is no part of the description"
    assert warm.doc == "Whether the room is warm"


def test_laws_are_plain_methods_and_declarations_leave_the_class():
    assert Divider().tap() == 6.0
    assert "supply" not in vars(Divider)
    assert isinstance(Divider.declared["tap"], OutputDeclaration)
    assert isinstance(Divider.declared["upper"], ParameterDeclaration)


def test_elements_of_an_array_are_variables_row_by_row():
    wall = Wall(**{"exchange[2]": 3.0})
    assert [wall.temperature[k] for k in (1, 2, 3)] == [1.0, 2.0, 4.0]
    assert wall.exchange[2] == 3.0
    wall.temperature[3] = 7.0
    assert getattr(wall, "temperature[3]") == wall.at(3) == 7.0
    outputs = dict(zip([o.name for o in wall.layout.outputs], wall.outputs(), strict=True))
    assert outputs["products[2,1]"] == 2.0
    assert outputs["products[1,3]"] == 7.0
    assert wall.rates() == [0.0, 3.0 * (1.0 - 4.0 + 7.0), 2.0 - 14.0]


def test_instances_have_elements_of_their_own():
    one, other = Wall(), Wall()
    one.temperature[1] = 9.0
    assert other.temperature[1] == 1.0


def test_python_integrates_an_array_of_states():
    """With no exchange a layer follows its heat alone."""
    wall = Wall(**{f"exchange[{k}]": 0.0 for k in (1, 2, 3)}, **{"heat[2]": 2.0})
    Integrator(wall).advance(0.0, 0.5)
    assert [wall.temperature[k] for k in (1, 2, 3)] == pytest.approx([1.0, 3.0, 4.0])


def test_a_subclass_has_another_size():
    class Thick(Wall):
        name = "thick"
        layers = 4
        temperature = Array(Wall.declared["temperature"].element, lambda wall: wall.layers)
        exchange = Array(Parameter(2.0, "1/s"), 4)

    shapes = {array.name: array.shape for array in Thick.layout.arrays}
    assert shapes["heat"] == shapes["temperature"] == shapes["temperature_start"] == (4,)
    assert {a.name: a.shape for a in Wall.layout.arrays}["heat"] == (3,)


def test_a_default_of_an_element_is_that_of_a_stack():
    warm = stack(Wall, defaults={"temperature_start[2]": 5.0, "exchange[3]": 4.0})
    starts = {p.name: p.start for p in warm.layout.parameters}
    assert [starts[f"temperature_start[{k}]"] for k in (1, 2, 3)] == [1.0, 5.0, 4.0]
    assert [starts[f"exchange[{k}]"] for k in (1, 2, 3)] == [1.0, 1.0, 4.0]
    assert warm.layout.arrays == Wall.layout.arrays


@pytest.mark.parametrize(
    ("array", "says"),
    [
        (Array(Parameter(1.0, "1"), 0), "array 'x' has 0 elements"),
        (Array(Parameter(1.0, "1")), "array 'x' has  elements"),
        (Array(Parameter(1.0, "1"), 2, 2, starts=[1.0]), "has 2 x 2 elements and 1 start values"),
        (Array(Parameter(1.0, "1", max=2.0), 2, starts=[1.0, 3.0]), r"'x\[2\]' starts at 3"),
    ],
)
def test_arrays_that_cannot_be_are_refused(array, says):
    with pytest.raises(UserError, match=says):
        type("Bad", (Component,), {"name": "bad", "x": array})


def test_the_name_of_an_array_of_start_values_is_taken():
    with pytest.raises(UserError, match="is of an array that has the name of another variable"):

        class Bad(Wall):
            name = "bad"
            temperature_start = Parameter(1.0, "K")


@pytest.mark.parametrize("unit", ["degC", "°C", "celsius", "degF", "K", "C", "F", "mm", "K/s"])
def test_the_unit_of_differences_is_that_of_pint(unit):
    assert of_differences(unit) == difference_unit(unit)


def test_a_constant_is_copied_with_its_unit():
    copied = pickle.loads(pickle.dumps(Constant(9.81, "m/s²")))
    assert (copied, copied.unit) == (9.81, "m/s²")
