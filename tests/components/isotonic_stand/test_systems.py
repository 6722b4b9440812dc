"""Claims: the actuator carries the stand, which follows it."""

from orchestration.system import library


def test_the_actuator_carries_what_the_stand_says_and_the_stand_follows():
    wires = {str(c.source): str(c.target) for c in library.system("isotonic_stand").connections}
    assert wires == {
        "galvanostat.current": "actuator.current",
        "actuator.voltage": "galvanostat.voltage",
        "stand.tension": "actuator.force",
        "actuator.displacement": "stand.displacement",
    }
