"""Small components with solutions on paper, for systems that become one FMU."""

from __future__ import annotations

from pathlib import Path

from fmus.kit import Component, Discrete, Input, Output, Parameter, State, where
from orchestration.system import Connection, Member, Port, System, connect
from tests.support.hosts import build_one_state_fmu

H = 0.1  # s, communication step of the chain


class Section(Component):
    """A resistor and a capacitor."""

    name = "section"
    tolerance = 1e-12
    tau = Parameter(0.5, "s", min=1e-3, doc="time constant", tunable=True)
    u = Input("V", doc="voltage at the resistor")
    v = State("V", rate="slope", output=True, doc="voltage of the capacitor")

    def slope(self):
        return (self.u - self.v) / self.tau


class Amplifier(Component):
    """A gain without memory, with a second input that is not amplified."""

    name = "amplifier"
    gain = Parameter(1.0, "1", doc="gain")
    u = Input("V", doc="amplified")
    w = Input("V", doc="added")

    @Output("V")
    def y(self):
        """The sum."""
        return self.gain * self.u + self.w


class Filter(Component):
    """A sampled filter: half of what it was and half of what comes, and whether that is high."""

    name = "filter"
    period = Parameter(0.3, "s", min=1e-3, doc="sample period")
    u = Input("mV", doc="filtered")
    x = Discrete("mV", update="next", period="period", output=True, doc="the mean")
    high = Discrete(
        "1", update="is_high", period="period", output=True, type="boolean", doc="above 400 mV"
    )

    def next(self):
        return 0.5 * (self.x + self.u)

    def is_high(self):
        return where(self.next() > 400.0, 1.0, 0.0)


class Lamp(Component):
    """A lamp behind a switch."""

    name = "lamp"
    on = Input("1", start=False, type="boolean", doc="whether the switch is closed")

    @Output("W")
    def power(self):
        """Power that it takes."""
        return where(self.on, 60.0, 0.0)


def chain() -> System:
    """Two sections, a filter in millivolts with an offset, and a lamp that it switches off."""
    members = (
        Member.of("first", Section, {"tau": 0.4}),
        Member.of("second", Section),
        Member.of("mean", Filter),
        Member.of("lamp", Lamp),
    )
    wires = (
        *connect("first.v -> second.u"),
        Connection(Port("second", "v"), Port("mean", "u"), factor=1000.0, offset=20.0),
        Connection(Port("mean", "high"), Port("lamp", "on"), table=((0.0, 1.0), (1.0, 0.0))),
    )
    outputs = {
        "v1": Port("first", "v"),
        "v2": Port("second", "v"),
        "mean": Port("mean", "x"),
        "light": Port("lamp", "power"),
    }
    inputs = {"u": (Port("first", "u"),)}
    return System("chain", members, wires, inputs, outputs, step=H, stop=3.0)


def circle(first: float = 0.5, second: float = -0.8) -> System:
    """Two amplifiers in an algebraic loop: each amplifies what the other gives."""
    members = (
        Member.of("a", Amplifier, {"gain": first}),
        Member.of("b", Amplifier, {"gain": second, "w": 0.25}),
    )
    wires = connect("a.y -> b.u", "b.y -> a.u")
    return System("circle", members, wires, {"w": (Port("a", "w"),)}, step=H)


def mixed(folder: Path) -> System:
    """A section, two FMUs of somebody else from one file, and a section: lags one after another."""
    fmu = build_one_state_fmu(folder)
    members = (
        Member.of("first", Section, {"tau": 0.4}),
        Member("second", fmu, {"tau": 0.3}),
        Member("third", fmu, {"tau": 0.7}),
        Member.of("last", Section),
    )
    wires = (
        Connection(Port("first", "v"), Port("second", "u"), factor=2.0, offset=-0.5),
        *connect("second.x -> third.u", "third.x -> last.u"),
    )
    outputs = {name: Port(name, variable) for name, variable in MIXED.items()}
    inputs = {"u": (Port("first", "u"),)}
    return System("mixed", members, wires, inputs, outputs, step=H, stop=3.0)


MIXED = {"first": "v", "second": "x", "third": "x", "last": "v"}  # outputs by member
