"""Claims: a port is a pair of variables whose product is the power that goes into a component."""

import re

import pytest

import fmus
from fmus.kit import Component, Input, Output, PowerPort, State, UserError, units
from fmus.kit.ports import DOMAINS


@pytest.mark.parametrize("domain", DOMAINS)
def test_the_product_is_a_power(domain):
    """Of a displacement or an angle it is an energy: that of the rate is a power."""
    potential, flow = DOMAINS[domain]
    if domain == "thermal":
        return  # a heat flow is a power itself (Modelica.Thermal.HeatTransfer.Interfaces)
    rate = "" if domain == "electrical" else "/s"
    product = units.base_unit(f"{potential}*{flow}{rate}").exponents
    assert {k: v for k, v in product.items() if k != "rad"} == units.base_unit("W").exponents


def test_power_of_the_ports_is_the_work_that_the_foot_counts():
    """Of the actuators, and of forces on the leg; what it counts is integrated from its laws."""
    cls = fmus.component("foot_free")
    foot = cls(
        an_tension=3.0,
        po_tension=1.0,
        do_tension=0.5,
        pl_tension=0.7,
        leg_force_x=-2.0,
        leg_force_y=0.6,
    )
    speeds = {"ankle_rate": 0.7, "tm_rate": -0.3, "mtp_rate": 0.4}
    speeds |= {"leg_velocity_x": 0.11, "leg_velocity_y": -0.07}
    vars(foot).update(speeds)
    rates = {s.name: rate for s, rate in zip(cls.layout.states, foot.rates(), strict=True)}

    def power(port):
        potential_rate = rates.get(port.potential)
        if potential_rate is None:
            potential_rate = getattr(foot, port.potential.replace("_change", "_rate"))()
        into = -1.0 if port.delivers else 1.0
        return into * getattr(foot, port.flow) * potential_rate

    of_legs = [p for p in cls.ports if p.name.startswith("leg")]
    of_actuators = [p for p in cls.ports if p not in of_legs]
    assert sum(map(power, of_actuators)) == pytest.approx(rates["actuator_work"], rel=1e-12)
    assert sum(map(power, of_legs)) == pytest.approx(rates["load_work"], rel=1e-12)


def declared(port):
    class Oven(Component):
        name = "oven"
        ports = (port,)
        heat = Input("W")
        temperature = State("K", rate="heating", output=True)

        def heating(self):
            return self.heat / 20.0

        @Output("1")
        def level(self):
            return self.temperature / 300.0

    return Oven


def test_what_a_port_names_is_checked():
    port = PowerPort("wall", "thermal", "temperature", "heat", ("wall",))
    assert declared(port).ports == (port,)


@pytest.mark.parametrize(
    ("port", "message"),
    [
        (("thermic", "temperature", "heat", ("a",)), "is 'thermic' (did you mean thermal?)"),
        (("thermal", "temp", "heat", ("a",)), "has 'temp', which is no input or output"),
        (("thermal", "level", "heat", ("a",)), "has 'level' in 1; it must be in K"),
        (("thermal", "temperature", "heat", ()), "has 0 connectors; it may have one or two"),
        (("thermal", "temperature", "heat", ("heat",)), "has a connector 'heat'; it must be"),
        (("thermal", "temperature", "heat", ("a b",)), "has a connector 'a b'; it must be"),
    ],
)
def test_a_mistake_in_a_port_shows_at_the_class(port, message):
    with pytest.raises(UserError, match=re.escape(f"Oven: port 'wall' {message}")):
        declared(PowerPort("wall", *port))
