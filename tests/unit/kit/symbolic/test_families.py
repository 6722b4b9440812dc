"""Families of effects: which a model's laws ask for, and what each does.

Oracles: the laws and units of small models, read by eye; equations of motion with the missing term,
written here and integrated by SciPy.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import Component, Input, Output, Parameter, State, sin, stack, units
from fmus.kit.build.building import RUNTIMES, build
from fmus.kit.build.toolchain import host_platform
from fmus.kit.curves import curve
from fmus.kit.effects import effect_name, made_with
from fmus.kit.record.compiled import CompiledModel
from fmus.kit.symbolic.families import families_for, list_laws
from orchestration.fmu.instance import Fmu
from orchestration.fmu.simulation import simulate_instance
from tests.support.kit_samples import Sledge
from tests.support.pushed_mass import ARM_CASES, BASE, DAMPER, FORCE, INPUT_CASES, MASS, TIME, Tank


def test_laws_are_told_with_their_units_and_what_they_read():
    found = {law.name: (law.unit, law.reads, law.is_rate, law.is_output) for law in list_laws(MASS)}
    assert found == {
        "elongation_rate": ("m/s", ("velocity",), True, False),
        "acceleration": ("m/s^2", ("force",), True, False),
        "damper_force": ("N", ("velocity",), False, False),
        "spring_force": ("N", ("elongation",), False, False),
        "position": ("m", ("elongation",), False, True),
    }
    tank = {law.name: (law.unit, law.reads) for law in list_laws(Tank)}
    assert tank["outflow"] == ("m^3/s", ("level",))
    assert tank["level_rate"] == ("m/s", ("inflow",))
    assert tank["odd"] == ("", ("inflow", "level")), "a sum that has no unit"


def test_what_fits_a_model_s_laws_is_listed():
    names = [effect_name(effect) for effect in families_for(MASS)]
    assert len(set(names)) == len(names)
    for name in (
        "coulomb_friction(damper_force)",
        "quadratic_drag(damper_force)",
        "cubic_stiffness(spring_force)",
        "upper_stop(spring_force)",
        "maxwell_arm(spring_force)",
        "force_offset",
        "dead_zone(force)",
        "backlash(force)",
    ):
        assert name in names
    assert not any("elongation_rate" in name or "position" in name for name in names), (
        "definitions and outputs"
    )
    tank = [effect_name(effect) for effect in families_for(Tank)]
    assert {"square_root_outflow(outflow)", "overflow(outflow)"} <= set(tank)
    assert "storing_law(outflow)" in tank
    assert "laminar_outflow(outflow)" not in tank, "the outlet's own parameter is that"
    assert "viscous_drag(damper_force)" not in names
    assert not any("odd" in name for name in tank)


@pytest.mark.parametrize("cls", [MASS, Tank])
def test_at_its_neutral_value_nothing_changes(cls):
    rng = np.random.default_rng(1)
    values = {v.name: float(rng.normal()) for v in (*cls.layout.inputs, *cls.layout.states)}
    for effect in families_for(cls):
        plain, extended = cls(), stack(cls, effect)()
        for name, value in values.items():
            setattr(plain, name, value)
            setattr(extended, name, value)
        assert extended.rates()[: len(plain.rates())] == plain.rates(), effect.id
        assert extended.outputs() == plain.outputs(), effect.id


@pytest.mark.parametrize("runtime", RUNTIMES)
def test_fmus_of_both_builds_have_them(tmp_path, runtime):
    cases = [*ARM_CASES.values(), *INPUT_CASES.values()]
    effects = [effect for effect, *_ in cases]
    effects += [
        curve(MASS, *DAMPER, s, "N") for s in ("odd_quadratic", "stribeck", "stops", "weir")
    ]
    cls = stack(MASS, *effects)
    values = BASE | {name: value for _, own, *_ in cases for name, value in own.items()}
    values |= {f"damper_force_{s}": 0.5 for s in ("odd_quadratic", "stribeck", "stops", "weir")}
    expected = (
        CompiledModel(cls).run(TIME[:200], {"force": FORCE[:200]}, values).signals["position"]
    )
    path = tmp_path / f"{runtime}.fmu"
    path.write_bytes(build(cls, runtime, [host_platform()]))
    with Fmu(path, values) as instance:
        instance.start(0.0, float(TIME[199]))
        found = simulate_instance(instance, TIME[:200], {"force": FORCE[:200]})
    assert np.abs(found["position"] - expected).max() < 1e-6


def test_what_nothing_brakes_may_have_drag():
    found = {effect_name(effect): effect for effect in families_for(Sledge)}
    drag = found["viscous_drag(acceleration)"]
    model = stack(Sledge, drag)(**{drag.neutral: -0.3})
    model.velocity, model.command = 2.0, 0.5
    assert model.rates() == [pytest.approx(0.5 / 2.0 - 0.3 * 2.0)]


class Followed(Component):
    """A spring whose motion is given."""

    name = "followed"
    stiffness = Parameter(1.0, "N/m")
    place = Input("m")

    def spring(self):
        """Force over place."""
        return self.stiffness * self.place

    @Output("N")
    def force(self):
        """As measured."""
        return self.spring()


def test_a_loop_that_goes_by_a_rate_is_not_for_inputs():
    names = [effect_name(effect) for effect in families_for(Followed)]
    assert "prandtl_play(spring)" in names
    assert "bouc_wen_hysteresis(spring)" not in names
    assert "bouc_wen_hysteresis(spring_force)" in map(effect_name, families_for(MASS))


class House(Component):
    """One store of heat; the loss is written the other way round where so wanted."""

    name = "house"
    way = 1.0
    loss = Parameter(80.0, "W/K")
    capacity = Parameter(5e6, "J/K")
    outdoor = Input("K", start=280.0)
    room = State("K", rate="warming", start=300.0)

    def flow(self):
        """Loss."""
        return self.way * self.loss * (self.room - self.outdoor)

    def warming(self):
        """Balance."""
        return -self.way * self.flow() / self.capacity

    @Output("K")
    def shown(self):
        """As measured."""
        return self.room


@pytest.mark.parametrize(
    ("way", "sides"), [(1.0, ("room", "outdoor")), (-1.0, ("outdoor", "room"))]
)
def test_a_flow_between_two_temperatures_may_store(way, sides):
    cls = type("Way", (House,), {"way": way, "name": "way"})
    wall = next(e for e in families_for(cls) if e.id == "storing_wall")
    assert effect_name(wall) == "storing_wall(flow)"
    assert made_with(wall)["sides"] == (("room", "outdoor") if way > 0.0 else ("outdoor", "room"))
    assert not [e for e in families_for(MASS) if e.id == "storing_wall"]


class Boiler(Component):
    """A vessel in kW, bar, g/s, mm and km/h, with numbers written into its laws."""

    name = "boiler"
    loss = Parameter(0.25, "kW/K")
    capacity = Parameter(12.0, "kW*h/K")
    valve = Parameter(2.0, "g/s/bar")
    volume = Parameter(16.0, "g/bar")
    spring = Parameter(3.0, "N/mm")
    mass = Parameter(0.2, "kg")
    drag = Parameter(0.1, "1/s")
    damping = Parameter(0.3, "N*m*s")
    inertia = Parameter(0.5, "kg*m^2")
    heating = Input("kW", nominal=4.0)
    room = State("K", rate="warming", start=291.0)
    ash = State("kg", rate="settling", start=1.0)
    pressure = State("bar", rate="filling", start=2.0)
    place = State("mm", rate="moving", start=1.0)
    speed = State("m/s", rate="pushed", start=0.5)
    way = State("km", rate="driven", start=1.0)
    angle = State("rad", rate="turning", start=0.3)
    spin = State("rad/s", rate="twisting", start=0.3)

    def envelope(self):
        """Heat lost."""
        return self.loss * (self.room - 280.0)

    def warming(self):
        """Balance."""
        return (self.heating - self.envelope()) / (3600.0 * self.capacity)

    def settling(self):
        """Decay with a rate that is written into it."""
        return -0.01 * self.ash

    def outflow(self):
        """Over the pressure of the air."""
        return self.valve * (self.pressure - 1.013)

    def filling(self):
        """Balance."""
        return -self.outflow() / self.volume

    def bent(self):
        """Spring."""
        return self.spring * self.place

    def moving(self):
        """Definition, mm/s of m/s."""
        return 1e3 * self.speed

    def weight(self):
        """With the acceleration of gravity written into it."""
        return 9.81 * self.mass

    def pushed(self):
        """Newton's law."""
        return (self.weight() - self.bent()) / self.mass

    def driven(self):
        """Definition, km/s of m/s."""
        return self.speed / 1000.0

    def turning(self):
        """Definition."""
        return -self.spin

    def friction(self):
        """In a unit without the angle."""
        return self.damping * self.spin

    def restoring(self):
        """Of a pendulum, over inertia, whose length is written into it."""
        return 9.81 / 0.5 * sin(self.angle)

    def twisting(self):
        """Balance."""
        return self.restoring() - self.friction() / self.inertia

    @Output("mm")
    def shown(self):
        """As measured."""
        return self.place


def test_the_unit_of_a_law_is_that_of_its_numbers():
    """Oracle: by hand, and the number of a law in its unit is what pint makes of the product."""
    found = {law.name: law.unit for law in list_laws(Boiler)}
    assert found == {
        "envelope": "kW",
        "warming": "K/s",
        "settling": "kg/s",
        "outflow": "g/s",
        "filling": "bar/s",
        "bent": "N",
        "moving": "mm/s",
        "weight": "N",
        "pushed": "m/s^2",
        "driven": "km/s",
        "turning": "rad/s",
        "friction": "N*m",
        "restoring": "rad/s^2",
        "twisting": "rad/s^2",
        "shown": "mm",
    }
    one = Boiler()
    registry = units.registry()
    lost = registry.Quantity(0.25, "kW/K") * registry.Quantity(11.0, "K")
    assert registry.Quantity(one.envelope(), found["envelope"]).to("W") == lost.to("W")
    flow = registry.Quantity(2.0, "g/s/bar") * registry.Quantity(2.0 - 1.013, "bar")
    assert registry.Quantity(one.outflow(), found["outflow"]).to("kg/s").magnitude == (
        pytest.approx(flow.to("kg/s").magnitude)
    )


def test_a_law_of_any_units_may_have_a_store_beside_it():
    """Where the field has a name of its own for the store, it is that."""
    found = {effect_name(effect): effect for effect in families_for(Boiler)}
    store = found["storing_law(outflow)"]
    amount, constant, state = store.declared
    model = stack(Boiler, store)(**{amount: 0.5, constant: 4.0})
    setattr(model, state, -0.2)
    more = 0.5 * 0.2  # of the pressure in equilibrium with the store at first
    assert model.outflow() == pytest.approx(Boiler().outflow() + more)
    assert getattr(model, f"{state}_rate")() == pytest.approx(0.2 / 4.0)
    assert {"lagging_law(outflow)", "thermal_node(envelope)"} <= set(found)
    assert not {"storing_law(envelope)", "storing_law(spring_force)"} & {
        *found,
        *map(effect_name, families_for(MASS)),
    }


def test_effects_are_in_the_units_of_a_model_and_of_laws_with_numbers_in_them():
    found = {effect_name(effect): effect for effect in families_for(Boiler)}
    node = found["thermal_node(envelope)"]
    assert units.convert(1.0, node.declared[node.neutral].unit, "W/K") == 1000.0
    assert "quadratic_law(outflow)" in found
    assert {"coulomb_friction(friction)", "cubic_law(restoring)", "force_offset"} <= set(found)


def test_the_definition_of_a_state_has_no_effects_whatever_its_units():
    found = [effect_name(effect) for effect in families_for(Boiler)]
    assert not [n for n in found if any(law in n for law in ("moving", "driven", "turning"))]
    assert "quadratic_law(settling)" in found, "of itself"
