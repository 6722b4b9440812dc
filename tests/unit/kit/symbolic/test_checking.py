"""The check of laws when a model is loaded. Oracle for units: one declaration of a model that fits
is changed to another unit, and cannot fit any more.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from fmus import MODELS, component, effects
from fmus.kit import (
    Component,
    Constant,
    Discrete,
    Effect,
    Input,
    Output,
    Parameter,
    State,
    UserError,
    sin,
    stack,
)
from fmus.kit.inputs import input_effects
from fmus.kit.sensors import measurement_effects
from fmus.kit.symbolic import check_component
from orchestration.fmu.model import catalogue, load_class

ROOT = Path(__file__).parents[4]
PLACES = [
    "examples/creep.py:Creep",
    "examples/mass_spring_damper.py:MassSpringDamper",
    "examples/positioning_stage.py:PositioningStage",
    "examples/positioning_stage.py:StageFollowed",
    "studies/plants/models/accelerometer.py:Accelerometer",
    "studies/plants/models/cell.py:Cell",
    "studies/plants/models/crane.py:Crane",
    "studies/plants/models/gear_motor.py:GearMotor",
    "studies/plants/models/house.py:House",
    "studies/plants/models/lithium_cell.py:LithiumCell",
    "studies/plants/models/loudspeaker.py:Loudspeaker",
    "studies/plants/models/motor.py:Motor",
    "studies/plants/models/pendulum.py:Pendulum",
    "studies/plants/models/ship.py:Ship",
    "studies/plants/models/tanks.py:Tanks",
    "studies/plants/models/thermal_nodes.py:ThermalNodes",
    "studies/plants/models/train.py:Train",
    "studies/plants/models/vessel.py:Vessel",
]
WITHOUT_NUMBERS = [
    place
    for place in PLACES
    if place.partition(":")[2] in ("Creep", "MassSpringDamper", "Cell", "Tanks", "ThermalNodes")
]


class Tank(Component):
    """A tank that empties through a pipe."""

    name = "tank"

    area = Parameter(0.5, "m^2", min=1e-3, doc="cross section")
    conductance = Parameter(2e-3, "m^2/s", min=0, doc="flow per level")
    inflow = Input("m^3/s")
    level = State("m", rate="level_rate", start=1.0)

    def pipe_flow(self):
        """Laminar flow."""
        return self.conductance * self.level

    def level_rate(self):
        """Balance."""
        return (self.inflow - self.pipe_flow()) / self.area

    @Output("m^3/s")
    def outflow(self):
        """Flow out."""
        return self.pipe_flow()


def changed(cls, **units):
    """Return a component with some variables declared in other units."""
    declared = {}
    for part in reversed(cls.__mro__):
        declared |= vars(part).get("declared", {})
    return type("Changed", (cls,), {n: replace(declared[n], unit=u) for n, u in units.items()})


def refusal(cls):
    with pytest.raises(UserError) as caught:
        check_component(cls)
    return str(caught.value)


@pytest.mark.slow
def test_components_fit_their_units_with_each_effect():
    for name in MODELS:
        check_component(component(name))
        for effect in effects(name).values():
            check_component(stack(component(name), effect))


@pytest.mark.parametrize("place", PLACES)
def test_examples_and_plants_fit_their_units_with_every_effect_there_is(place):
    cls = load_class(f"{ROOT / place}")
    for effect in (*catalogue(cls).values(), *input_effects(cls), *measurement_effects(cls)):
        check_component(stack(cls, effect))


@pytest.mark.parametrize("place", WITHOUT_NUMBERS)
@pytest.mark.parametrize("more", ["m", "s/h"])
def test_no_unit_can_be_another_one(place, more):
    """A law without numbers is homogeneous in its units, so that none can change alone."""
    cls = load_class(f"{ROOT / place}")
    layout = cls.layout
    for v in (*layout.parameters, *layout.inputs, *layout.states, *layout.outputs):
        if v.name not in layout.start_parameters:
            unit = more if v.unit == "1" else f"({v.unit})*{more}"
            told = refusal(changed(cls, **{v.name: unit}))
            assert re.search(r"different kinds|1 \S+ is 3600 |gives", told), v.name


def test_a_charge_in_hours_beside_seconds_is_refused_with_factor_and_law():
    class Battery(Component):
        name = "battery"

        capacity = Parameter(2.3, "A*h", min=0.1)
        current = Input("A")
        charge = State("1", rate="charge_rate", start=1.0)

        def charge_rate(self):
            return -self.current / self.capacity

        @Output("1")
        def state_of_charge(self):
            return self.charge

    told = refusal(Battery)
    assert "charge_rate" in told
    assert "1 1/s is 3600 1/h" in told
    assert "capacity (A*h)" in told
    assert str(Path(__file__).name) in told

    class Converted(Battery):
        def charge_rate(self):
            return -self.current / (3600.0 * self.capacity)

    check_component(Converted)
    check_component(changed(Battery, capacity="A*s"))


def test_a_flow_in_another_unit_is_refused_with_the_units_that_stand_there():
    told = refusal(changed(Tank, conductance="m^3/s"))
    assert "in level_rate in 'self.inflow - self.pipe_flow()'" in told
    assert "inflow is declared in m^3/s" in told
    assert "pipe_flow() gives m^4/s" in told


def test_a_constant_has_its_unit():
    class Weight(Component):
        name = "weight"

        mass = Parameter(1.0, "kg", min=0.0)

        @Output("N")
        def force(self):
            return Constant(9.81, "m/s^2") * self.mass

    check_component(Weight)
    assert "force gives kg*m^2/s^2" in refusal(changed(Weight, mass="kg*m"))
    assert Weight().force() == 9.81


def test_a_period_that_is_not_in_seconds_is_refused():
    class Counter(Component):
        name = "counter"

        period = Parameter(10.0, "ms", min=1.0)
        count = Discrete("1", update="next_count", period="period", output=True)

        def next_count(self):
            return self.count + 1

    assert "period is in ms, but a sample period is in s" in refusal(Counter)
    check_component(changed(Counter, period="s"))


def test_laws_that_compute_with_bare_numbers_are_named():
    class Switched(Tank):
        name = "switched"
        unchecked = ("pipe_flow",)

        def pipe_flow(self):
            return self.conductance + self.level

    check_component(Switched)
    again = type("Again", (Switched,), {"unchecked": ()})
    assert "m^2/s and m are of different kinds" in refusal(again)
    misspelt = type("Misspelt", (Switched,), {"unchecked": ("pipe_flw",)})
    assert "no law named 'pipe_flw' (did you mean pipe_flow?)" in refusal(misspelt)


def test_an_effect_is_checked_over_its_component():
    class Turbulence(Effect):
        id = "turbulence"
        neutral = "share"

        share = Parameter(0.0, "1")

        def pipe_flow(self):
            return super().pipe_flow() + self.share * self.level

    assert "m^3/s and m are of different kinds" in refusal(stack(Tank, Turbulence))


def test_a_component_is_evaluated_once():
    calls = []

    class Counted(Tank):
        name = "counted"

        def pipe_flow(self):
            calls.append(self)
            return super().pipe_flow()

    check_component(Counted)
    first = len(calls)
    check_component(Counted)
    assert len(calls) == first > 0


def test_a_course_over_the_time_is_written_in_numbers():
    class Forced(Tank):
        name = "forced"

        def pipe_flow(self):
            return 0.01 * sin(self.time) * self.conductance * self.level

    check_component(Forced)
