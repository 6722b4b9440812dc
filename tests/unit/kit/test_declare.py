"""Claims: a declaration describes a variable and leaves the class."""

from fmus.kit.declare import OutputDeclaration, ParameterDeclaration
from tests.support.kit_samples import Divider, Thermostat


def test_description_of_an_output_is_the_first_line_of_its_docstring():
    power, warm = Thermostat.layout.outputs
    assert power.doc == "Electric power. The second sentence is no part of the description"
    assert warm.doc == "Whether the room is warm"


def test_laws_are_plain_methods_and_declarations_leave_the_class():
    assert Divider().tap() == 6.0
    assert "supply" not in vars(Divider)
    assert isinstance(Divider.declared["tap"], OutputDeclaration)
    assert isinstance(Divider.declared["upper"], ParameterDeclaration)
