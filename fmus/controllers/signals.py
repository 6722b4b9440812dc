"""Signals that the controllers of a displacement by a current have in common."""

from __future__ import annotations

from typing import Any

from ..kit import Component, Discrete, Input, Output, Parameter


def largest_current(doc: str = "largest current in either direction") -> Any:
    """Declare the limit of the current in A, that of the galvanostat in thesis table 2-2."""
    source = "thesis table 2-2 (HA-151)"
    return Parameter(1.3, "A", min=1e-9, max=1e6, source=source, tunable=True, doc=doc)


def sampled_length(update: str, doc: str, output: bool = False) -> Any:
    """Declare a length in m that changes at samples only.

    Parameters
    ----------
    update : str
        Law of its value after a sample.
    doc : str
    output : bool
        Whether it is an output, too.
    """
    return Discrete(
        "m",
        update=update,
        period="sample_period",
        nominal=1e-4,
        display="mm",
        output=output,
        doc=doc,
    )


class CurrentController(Component):
    """Controller of a displacement by a current, which is held between samples."""

    sample_period = Parameter(
        0.02, "s", min=1e-4, max=10.0, nominal=0.01, doc="sample period of the controller (h)"
    )
    reference = Input("m", nominal=1e-4, display="mm", doc="wanted displacement")
    displacement = Input("m", nominal=1e-4, display="mm", doc="measured displacement")

    def issued_current(self) -> Any:
        """Command of the controller to the actuator."""
        raise NotImplementedError

    @Output("A")
    def command(self) -> Any:
        """Current for the actuator, held between sample instants."""
        return self.issued_current()
