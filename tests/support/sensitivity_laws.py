"""Laws whose sensitivities are known in closed form, and sweeps of them."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np

import orchestration as ppy
from fmus.kit import Component, Input, Output, Parameter

TIME = np.array([0.0, 1.0])
# of the FMU in the folder of the tests
CALL = ("sweep", "one_state.fmu", "--stop", "1s", "--step", "0.1s", "--over", "tau=0.5..2")


class Laws(Component):
    """A linear law, a bilinear one, and one that depends on nothing."""

    name = "laws_of_sensitivity"
    a = Parameter(2.0, "V", doc="offset")
    b = Parameter(3.0, "ohm", doc="resistance")
    c = Parameter(1.0, "1", min=0.1, doc="factor")
    u = Input("A", start=4.0, doc="current")

    @Output("V", nominal=1.0)
    def linear(self):
        """Return a linear combination of all parameters."""
        return 2.0 * self.a + self.b - 4.0 * self.c

    @Output("V", nominal=1.0)
    def product(self):
        """Return the product of a parameter and the input."""
        return self.b * self.u

    @Output("V", nominal=1.0)
    def still(self):
        """Return a constant."""
        return 7.0 + 0.0 * self.a


def swept(model, over, **more):
    return ppy.sweep(
        model, over, time=TIME, **{"keep": ["last"], "kind": "sobol-indices", "samples": 64} | more
    )


def words(picture):
    """Return the texts of a picture, whose glyphs stand beside comments that have them."""
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    tree = ElementTree.parse(picture, parser)
    return [
        str(element.text).strip() for element in tree.iter() if element.tag is ElementTree.Comment
    ]
