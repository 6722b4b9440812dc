"""The systems that ship: what is connected with what, and at which step they are good to run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import tanh
from typing import Any

from fmus import component, effects
from fmus.kit import Component, stack
from fmus.kit.errors import UserError, suggestion
from orchestration.system.model import Connection, Member, Port, System, connect
from orchestration.system.voltmeter import Voltmeter

FEET = ("an", "po", "do", "pl")  # the actuators of a foot
# Tension in N of the actuators with the longer arms while the foot rests; that of their antagonists balances it. Two
# coulombs slacken an actuator by less than 1 N.
PRETENSION = {"po": 5.0, "pl": 5.0}
_ANTAGONIST = {"po": "an", "pl": "do"}

# The five-hour life (section 4.3, figs. 4-5 to 4-7): an actuator that warms up, and whose series resistance grows.
AMPLITUDE, FREQUENCY = 1.3, 0.1  # A, Hz, of the square wave of current
FIRST_VOLTAGE = 1.15  # V, the printed amplitude at the start

# R1 falls as the actuator warms up, and grows with the charge moved. The thesis prints the time of the minimum, 2100 s,
# and a rise by 15 to 25 % in a lifetime. The conductance of electrolytes (0.02/K) and the heat capacity (50 J/K) are
# those of the effect; cooling half as well as its default and the growth rate are chosen to give a minimum at 2100 s
# and 16 % from there to the end.
AGEING = {
    "resistance_growth_rate": 6.7e-5,
    "conductance_rise_per_kelvin": 0.02,
    "thermal_resistance": 40.0,
    "thermal_time": 2000.0,
}
# Just above the first voltages, so that derating is felt within the life; a design parameter (section 4.2).
ESTIMATOR = {"initial_voltage_limit": 1.2}


def _outputs(*ports: str) -> dict[str, Port]:
    """Outputs of a system, named after the variables."""
    pairs = [port.split(".") for port in ports]
    return {variable: Port(member, variable) for member, variable in pairs}


def _bench(name: str, actuator: str, of: str, doc: str, runtime: str) -> System:
    """Return the bench with whatever component takes the actuator's place, under a name of its own."""
    return System(
        name,
        (
            Member.of("bench", component("voice_coil_dma"), {"hold": 0.0}, runtime),
            Member.of(actuator, component(of), runtime=runtime),
        ),
        connect(
            f"bench.position -> {actuator}.length_change", f"{actuator}.tension -> bench.tension"
        ),
        {
            "force_reference": (Port("bench", "force_reference"),),
            "current": (Port(actuator, "current"),),
        },
        _outputs(
            f"{actuator}.tension", f"{actuator}.voltage", "bench.position", "bench.force_measured"
        ),
        doc,
        step=1e-4,  # at 1e-3 a Jacobi master overshoots by a fifth more
        stop=5.0,
    )


def dma_bench(runtime: str) -> System:
    """Voice coil that keeps an actuator at a wanted force while current goes through it (thesis section 2.2)."""
    return _bench(
        "dma_bench", "actuator", "ppy_actuator_length_driven", _summary(dma_bench), runtime
    )


def hil_bench(runtime: str) -> System:
    """Bench whose actuator is a real one: the member ``proxy`` stands for it and asks the rig (``ppy rig serve``).

    The proxy has the signals of the actuator, so that another FMU with the same signals can replace it.
    """
    bench = _bench("hil_bench", "proxy", "rig_proxy_length_driven", _summary(hil_bench), runtime)
    return replace(
        bench, step=1e-3, stop=30.0
    )  # an exchange with the rig for each step; 1 kHz is what a link can do


def degradation_watch(runtime: str) -> System:
    """Galvanostat, an actuator that ages, and an estimator that lowers the voltage limit (thesis sections 4.2, 4.3)."""
    step = 0.1
    drive = {"protection_period": step, "control_period": step, "voltage_command": 0.0}
    films = {"C": capacitance()} | AGEING
    watch = {"sample_period": step} | ESTIMATOR
    return System(
        "degradation_watch",
        (  # the estimator first: it samples what is there before the protection acts on the same sample
            Member.of("estimator", component("degradation_estimator"), watch, runtime),
            Member.of("galvanostat", component("galvanostat"), drive, runtime),
            Member.of("actuator", ageing_actuator(), films, runtime),
        ),
        connect(
            "galvanostat.current -> actuator.current",
            "galvanostat.current -> estimator.current",
            "actuator.voltage -> estimator.voltage",
            "actuator.voltage -> galvanostat.voltage",
            "estimator.voltage_limit -> galvanostat.voltage_limit",
        ),
        {
            "current_command": (Port("galvanostat", "current_command"),),
            "force": (Port("actuator", "force"),),
        },
        _outputs(
            "galvanostat.current",
            "actuator.voltage",
            "actuator.displacement",
            "estimator.voltage_limit",
        ),
        _summary(degradation_watch),
        step=step,
        stop=18000.0,
    )


def with_voltmeter(system: System, source: str, runtime: str = "native") -> System:
    """System in which a voltage is measured before anybody receives it.

    Parameters
    ----------
    system : System
    source : str
        Output ``member.variable``, in V; what was connected to it receives ``voltmeter.measured_voltage``.
    runtime : {"native", "python"}
        Which build of the voltmeter.

    Returns
    -------
    System
        It has an input more, ``voltage_error`` in V: 0, or measurement noise that it is driven with.

    Raises
    ------
    UserError
        If there is no such member, or the voltmeter cannot be built.
    """
    port, measured = system.port(source), Port("voltmeter", "measured_voltage")
    moved = (replace(c, source=measured) if c.source == port else c for c in system.connections)
    return replace(
        system,
        members=(*system.members, Member.of("voltmeter", Voltmeter, runtime=runtime)),
        connections=(*moved, Connection(port, Port("voltmeter", "voltage"))),
        inputs={**system.inputs, "voltage_error": (Port("voltmeter", "error"),)},
    )


def ageing_actuator() -> type[Component]:
    """Class of the actuator that warms up and whose series resistance grows with use."""
    known = effects("ppy_actuator")
    chosen = known["resistance_growth"], known["self_heating"]
    return stack(component("ppy_actuator"), *chosen, name="ageing_actuator")


def periodic_voltage(R1: float, R2: float, C: float) -> float:
    """Largest voltage in V of a circuit in ohm and F under that square wave, once it has lasted.

    In the periodic state the charge swings by ``tanh(T / (4 tau))`` of its final value.
    """
    swing = tanh(1.0 / (4.0 * FREQUENCY * (R1 + R2) * C))
    return AMPLITUDE * R2 * (R1 + R2 * swing) / (R1 + R2)


def capacitance() -> float:
    """Capacitance in F at which the fresh circuit of table 3-1 answers with the first voltage that is printed."""
    from scipy.optimize import brentq

    fresh: Any = component("ppy_actuator")()
    return float(
        brentq(lambda C: periodic_voltage(fresh.R1, fresh.R2, C) - FIRST_VOLTAGE, 0.1, 100.0)
    )


def foot_gait(runtime: str) -> System:
    """Foot that moves under four actuators, each driven by its current (thesis chapter 5)."""
    foot: Any = component("foot_dynamic")
    actuator: Any = component("ppy_actuator_length_driven")
    stiffness = actuator().k1
    wires = [
        (f"foot.{a}_length_change -> {a}.length_change", f"{a}.tension -> foot.{a}_tension")
        for a in FEET
    ]
    return System(
        "foot_gait",
        (
            Member.of("foot", foot, runtime=runtime),
            # an actuator that has flowed to a shorter length than it is held at is under tension
            *(
                Member.of(a, actuator, {"maxwell_elongation_start": -tension / stiffness}, runtime)
                for a, tension in sorted(
                    balanced(foot()).items(), key=lambda pair: FEET.index(pair[0])
                )
            ),
        ),
        connect(*(wire for pair in wires for wire in pair)),
        {f"{a}_current": (Port(a, "current"),) for a in FEET}
        | {f"toe_force_{axis}": (Port("foot", f"toe_force_{axis}"),) for axis in "xy"},
        _outputs("foot.ankle_angle", "foot.tm_angle", "foot.mtp_angle", "foot.toe_x", "foot.toe_y"),
        _summary(foot_gait),
        step=1e-4,  # at 5e-4 a Jacobi master lets the toe oscillate ever more
        stop=2.0,
    )


def balanced(foot: Component) -> dict[str, float]:
    """Tensions in N of the four actuators under which the foot rests in its reference configuration.

    Parameters
    ----------
    foot : Component
        A foot at zero joint angles, with the arms of its actuators as laws.
    """
    tensions = dict(PRETENSION)
    for one, other in _ANTAGONIST.items():
        arm, against = (getattr(foot, f"{a}_arm")() for a in (one, other))
        tensions[other] = -PRETENSION[one] * arm / against
    return tensions


def _summary(make: Callable[[str], System]) -> str:
    return (make.__doc__ or "").splitlines()[0]


_SYSTEMS = {make.__name__: make for make in (dma_bench, degradation_watch, foot_gait, hil_bench)}
NAMES = tuple(_SYSTEMS)
SUMMARIES = {name: _summary(make) for name, make in _SYSTEMS.items()}


def system(name: str, runtime: str = "native") -> System:
    """Return a system that ships; its FMUs are built unless the cache has them.

    Parameters
    ----------
    name : {"dma_bench", "degradation_watch", "foot_gait", "hil_bench"}
    runtime : {"native", "python"}
        Which build of its members.

    Raises
    ------
    UserError
        If there is no such system or runtime, or an FMU cannot be built.
    """
    if name not in _SYSTEMS:
        raise UserError(f"no system named {name!r}{suggestion(name, _SYSTEMS)}")
    return _SYSTEMS[name](runtime)
