"""Claims: constants of a program are known unless what it commands is measured."""

from __future__ import annotations

from typing import Any

import pytest

from fmus.kit import Component, Discrete, Output, Parameter, State
from orchestration.diagnosis.systems.program import program_constants


class SampledHeater(Component):
    """A heater that is switched by a program: ``dT/dt = power u - loss T``."""

    name = "sampled_heater"
    power = Parameter(2.0, "1/s")
    loss = Parameter(0.5, "1/s")
    gain = Parameter(3.0, "1")
    share = Parameter(0.5, "1", doc="of a program that corrects the sensor, which has it too")
    temperature = State("1", rate="warming")
    command = Discrete("1", update="next_command", period=0.1)

    def warming(self) -> Any:
        """Of the plant."""
        return self.power * self.command - self.loss * self.temperature

    def next_command(self) -> Any:
        """Of the program."""
        return self.gain * (1.0 - self.share * self.temperature)

    @Output("1")
    def sensed(self) -> Any:
        """Measured temperature."""
        return self.share * self.temperature

    @Output("1")
    def shown(self) -> Any:
        """Command."""
        return 2.0 * self.command


@pytest.mark.parametrize(
    ("measured", "constants"), [(["sensed"], ["gain"]), (["sensed", "shown"], [])]
)
def test_constants_of_a_program_are_known_unless_what_it_commands_is_measured(
    measured: list[str], constants: list[str]
) -> None:
    assert program_constants(SampledHeater, measured) == constants
