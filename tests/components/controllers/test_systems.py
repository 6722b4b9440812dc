"""Claims: commands of a work loop are added before they are limited."""

from fmus import component
from orchestration.system import library


def test_commands_of_a_work_loop_are_added_before_they_are_limited():
    wires = {(str(c.source), str(c.target)) for c in library.system("work_loop").connections}
    measured = {
        (f"actuator.{signal}", f"{member}.{signal}")
        for signal, member in (
            ("displacement", "feedback"),
            ("displacement", "learning"),
            ("voltage", "feedback"),
            ("voltage", "galvanostat"),
        )
    }
    assert wires - measured == {
        ("feedforward.command", "learning.feedback_command"),
        ("learning.command", "feedback.command_beside"),
        ("feedback.command", "galvanostat.current_command"),
        ("galvanostat.current", "actuator.current"),
        ("galvanostat.current", "feedback.current"),
    }
    assert measured <= wires


def test_the_actuator_neither_lags_nor_saturates_by_default():
    lagging = library.system("work_loop").member("actuator").cls()
    nominal = component("ppy_actuator")()
    for one in (lagging, nominal):
        one.charge = 1.5
    assert lagging.displacement() == nominal.displacement()
