"""Claims: every component's linear model is that of its equations, within 1e-6.

Oracles: thesis eq. 3.9 in closed form for the actuator, central differences of the laws evaluated
on floats and of an integration of its own for every component, arithmetic for loops.
"""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np
import pytest

from fmus import COMPONENTS, component
from fmus.kit import Component, Input, Output, Parameter, State, UserError
from fmus.kit.integrate import Integrator
from orchestration.linear.model import w_plane
from orchestration.linear.operating_point import point_at, start_point
from orchestration.linear.subject import subject_of
from orchestration.system import library
from orchestration.system.model import Connection, Member, Port, System, connect
from tests.contract.subjects import SUBJECTS
from tests.support.pace import slow_but

S = 2j * np.pi * np.logspace(-4, 2, 25)
R1, R2, C, ALPHA, K1, B1, K2, B2 = 0.43, 2.35, 2.70, 6.8e-5, 6300.0, 1.7e6, 1.0e4, 2.0e6
WITHIN_LIMITS = {"voice_coil_dma": {"voltage_command_start": 0.5}}


def test_the_actuator_is_equation_3_9():
    subject = subject_of(component("ppy_actuator"))
    model = subject.linearise(start_point(subject.graph, {"current": 0.3, "force": 1.0}))
    charge = R2 * C / (1.0 + (R1 + R2) * C * S)
    creep = 1.0 / K1 + 1.0 / (B1 * S) + 1.0 / (K2 + B2 * S)
    pairs = {
        ("current", "voltage"): R1 * (R2 - charge / C) / (R1 + R2) + charge / C,
        ("current", "displacement"): ALPHA * charge,
        ("force", "displacement"): creep,
        ("force", "voltage"): 0.0 * S,
    }
    for (into, out), exact in pairs.items():
        found = model.response(S.imag / (2.0 * np.pi), into, out)
        np.testing.assert_allclose(found, exact, rtol=1e-10, atol=1e-14)
    assert model.units["displacement"] == "m"
    assert model.method == "Jacobians of the laws"


def started(name):
    """An operating point of a component at which every law acts, away from kinks."""
    subject = subject_of(component(name))
    values = {**SUBJECTS[name].started, **SUBJECTS[name].inputs, **WITHIN_LIMITS.get(name, {})}
    return subject, start_point(subject.graph, values)


def signals_after(cls, point, columns, values, period):
    """Outputs at once, then states and discrete states after a period (0 gives rates instead)."""
    held = dict(zip(columns, values, strict=True))
    one = cls(
        **point.parameters, **(point.inputs | {n: held[n] for n in held if n in point.inputs})
    )
    for name in (*point.states, *point.discretes):
        setattr(one, name, held.get(name, (point.states | point.discretes)[name]))
    outputs = one.outputs()
    if not period:
        return np.array([*one.rates(), *outputs], dtype=float)
    integrator = Integrator(one)
    integrator.tolerance = 1e-12
    integrator.advance(0.0, period)
    after = [getattr(one, name) for name in (*point.states, *point.discretes)]
    return np.array([*after, *outputs], dtype=float)


@pytest.mark.parametrize(
    "name", slow_but(COMPONENTS, *(n for n in COMPONENTS if n != "voice_coil_dma"))
)
def test_every_component_is_linearised_as_central_differences_of_it_are(name):
    subject, point = started(name)
    layout = subject.graph.layout
    outputs = [v.name for v in layout.outputs if v.type == "real"]
    model = subject.linearise(point, outputs=outputs)
    m = model.matrices
    columns = [*model.states, *model.inputs]
    centre = np.array([point.values[n] for n in columns])
    declared = {v.name: v for v in layout.variables}
    sizes = [1e-3 * max(declared[n].nominal, abs(v)) for n, v in zip(columns, centre, strict=True)]
    known = [
        *point.states,
        *(point.discretes if m.period else ()),
        *(v.name for v in layout.outputs),
    ]
    cls = component(name)

    def difference(k, size):
        aside = size * np.eye(len(columns))[k]
        up, down = (
            signals_after(cls, point, columns, centre + sign * aside, m.period) for sign in (1, -1)
        )
        return (up - down) / (2.0 * size)

    for k, size in enumerate(sizes):
        # Richardson: the error of a central difference falls with the square of its size
        exact = (4.0 * difference(k, size / 2.0) - difference(k, size)) / 3.0
        by_name = dict(zip(known, exact, strict=True))
        scale = {n: declared[n].nominal / declared[columns[k]].nominal for n in known}
        found = np.vstack([np.hstack([m.A, m.B]), np.hstack([m.C, m.D])])[:, k]
        for signal, value in zip([*model.states, *outputs], found, strict=True):
            error = abs(value - by_name[signal])
            assert error <= 1e-6 * max(scale[signal], abs(value)), (columns[k], signal)


class Pi(Component):
    """The continuous controller of thesis section 2.2.3, 18 (0.02 s + 1)/s."""

    name = "pi"
    wanted = Input("N", doc="reference")
    measured = Input("N", doc="measured force")
    integral = State("V", rate="error", doc="integral part")

    def error(self):
        return 18.0 * (self.wanted - self.measured)

    @Output("V")
    def volts(self):
        """Voltage."""
        return self.integral + 0.02 * self.error()


class Coil(Component):
    """A blocked coil: (K/R)/((L/R)s + 1) with the numbers of appendix A1."""

    name = "coil"
    K = Parameter(3.9, "N/A", doc="force constant")
    volts = Input("V", doc="voltage")
    amperes = State("A", rate="current_rate", doc="current")

    def current_rate(self):
        return (self.volts - 3.0 * self.amperes) / 1e-3

    @Output("N")
    def force(self):
        """Force of the coil."""
        return self.K * self.amperes


@pytest.fixture(scope="module")
def loop():
    wires = connect("pi.volts -> coil.volts", "coil.force -> pi.measured")
    return System(
        "loop",
        (Member.of("pi", Pi), Member.of("coil", Coil)),
        wires,
        {"wanted": (Port("pi", "wanted"),)},
        {"force": Port("coil", "force")},
    )


@pytest.mark.parametrize("cut", ["pi.measured", "coil.force", "coil.volts", "pi.volts"])
def test_the_thesiss_loop_has_the_margins_that_are_printed_wherever_it_is_cut(loop, cut):
    subject = subject_of(loop)
    cut_open = subject.loop(start_point(subject.graph, {}), cut)
    margins = cut_open.margins()
    assert (round(margins.phase, 1), round(margins.crossover, 2)) == (117.4, 4.21)
    exact = 18.0 * (0.02 * S + 1.0) / S * 1.3 / (1.0 + S / 3000.0)
    np.testing.assert_allclose(cut_open.response(S.imag / (2.0 * np.pi)), exact, rtol=1e-9)
    assert np.isinf(margins.gain)


def test_the_bench_has_them_with_its_slide_blocked_and_its_controller_in_the_w_plane():
    subject = subject_of(component("voice_coil_dma"))
    point = start_point(subject.graph, {"force_reference": 1.0})
    law = subject.linearise(point, ["force_filtered"], ["next(voltage_command)"])
    coil = subject.linearise(point, ["voltage_command", "velocity"], ["coil_current"])
    open_loop = -3.9 * w_plane(law.part()) * coil.part()
    _, phase, _, crossover = control.margin(open_loop)
    assert (round(phase, 1), round(crossover / (2.0 * np.pi), 2)) == (117.4, 4.21)


def test_a_connection_with_a_factor_and_several_readers_is_cut_as_one(loop):
    factor = Connection(Port("coil", "force"), Port("pi", "measured"), 2.0, 0.5)
    subject = subject_of(System("l", loop.members, (loop.connections[0], factor), loop.inputs, {}))
    point = start_point(subject.graph, {})
    np.testing.assert_allclose(
        subject.loop(point, "coil.force").response(np.array([1.0])),
        2.0 * subject_of(loop).loop(point, "coil.force").response(np.array([1.0])),
        rtol=1e-12,
    )


def test_a_sampled_loop_is_as_far_from_instability_as_its_gain_margin_says():
    subject = subject_of(library.system("dma_bench"))
    point = point_at(subject.graph, 1.0, {"force_reference": 1.0})
    margins = subject.loop(point, "bench.force_filtered").margins()
    gains = {"bench.error_gain": 0.66, "bench.previous_error_gain": -0.06}
    for share, is_stable in ((0.999, True), (1.001, False)):
        louder = {n: v * margins.gain * share for n, v in gains.items()}
        there = replace(point, parameters=point.parameters | louder)
        poles = subject.linearise(there, ["force_reference"], ["position"]).poles()
        # the integrator of the creep, and of the position over it, stays at one
        fast = poles[np.abs(poles - 1.0) > 1e-2]
        assert (np.abs(fast).max() < 1.0) == is_stable


def test_a_loop_whose_cut_is_read_between_samples_says_so():
    subject = subject_of(library.system("dma_bench"))
    point = point_at(subject.graph, 1.0, {"force_reference": 1.0})
    told = "acts between samples"
    assert told in subject.loop(point, "bench.tension").notes[-1]
    assert told not in " ".join(subject.loop(point, "bench.force_filtered").notes)


def test_a_cut_through_which_no_loop_goes_says_so():
    subject = subject_of(component("ppy_actuator"))
    cut = subject.loop(start_point(subject.graph, {}), "charge")
    assert cut.notes == ("nothing comes back to the cut: no loop goes through charge here",)
    assert np.isinf(cut.margins().gain)
    assert "pole" not in str(cut)


def test_what_has_no_laws_or_no_such_connection_is_refused_in_a_line(loop):
    with pytest.raises(UserError, match="rig_proxy is computed by an engine"):
        subject_of(component("rig_proxy"))
    with pytest.raises(UserError, match="hil_bench: proxy is computed by an engine"):
        subject_of(library.system("hil_bench"))
    subject = subject_of(loop)
    with pytest.raises(
        UserError, match=r"no state and no connection .*coil\.force -> pi\.measured"
    ):
        subject.loop(start_point(subject.graph, {}), "coil.farce")
    alone = subject_of(component("ppy_actuator"))
    with pytest.raises(UserError, match="no state and no connection of this name"):
        alone.loop(start_point(alone.graph, {}), "voltage")


def test_a_component_that_moves_at_its_operating_point_is_said_to():
    """The charge of an actuator at constant current; at rest, and in an equilibrium, nothing."""
    subject = subject_of(component("ppy_actuator"))
    moving = start_point(subject.graph, {"current": 0.5})
    rate = 0.5 * R2 / (R1 + R2)
    told = subject.linearise(moving, ["current"], ["voltage"]).notes
    assert told == (f"not at rest here: charge changes by {rate:.3g} C per second",)
    resting = start_point(subject.graph, {})
    assert subject.linearise(resting, ["current"], ["voltage"]).notes == ()
    trimmed = replace(moving, trimmed=True)
    assert subject.linearise(trimmed, ["current"], ["voltage"]).notes == ()
