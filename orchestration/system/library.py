"""The systems of this project: benches, the stand, degradation watches, and the foot."""

from __future__ import annotations

from dataclasses import replace
from math import tanh
from typing import Any

from fmus import component, effects
from fmus.kit import Component, stack
from fmus.kit.errors import UserError, suggestion
from orchestration.system.model import Connection, Member, Port, System, connect
from orchestration.system.voltmeter import Voltmeter

# a galvanostat by current: 15 V, its compliance, is no protection
_UNPROTECTED = {"voltage_command": 0.0, "voltage_limit": 15.0}
FEET = ("an", "po", "do", "pl")  # the actuators of a foot
# Tension in N of the actuators with the longer arms while the foot rests; that of their antagonists
# balances it. Two coulombs slacken an actuator by less than 1 N.
PRETENSION = {"po": 5.0, "pl": 5.0}
_ANTAGONIST = {"po": "an", "pl": "do"}

# The five-hour life (section 4.3, figs. 4-5 to 4-7): an actuator that warms up, and whose series
# resistance grows.
AMPLITUDE = 1.3  # A, of the square wave of current
FREQUENCY = 0.1  # Hz, of the square wave of current
FIRST_VOLTAGE = 1.15  # V, the printed amplitude at the start

# R1 falls as the actuator warms up, and grows with the charge moved. The thesis prints the time of
# the minimum, 2100 s, and a rise by 15 to 25 % in a lifetime. The conductance of electrolytes
# (0.02/K) and the heat capacity (50 J/K) are those of the effect; cooling half as well as its
# default and the growth rate are chosen to give a minimum at 2100 s and 16 % from there to the end.
AGEING = {
    "resistance_growth_rate": 6.7e-5,
    "conductance_rise_per_kelvin": 0.02,
    "thermal_resistance": 40.0,
    "thermal_time": 2000.0,
}
# Just above the first voltages, so that derating is felt within the life; a design parameter
# (section 4.2).
ESTIMATOR = {"initial_voltage_limit": 1.2}

# by system; these texts are in the descriptions of its SSP files
SUMMARIES = {
    "dma_bench": (
        "Voice coil that keeps an actuator at a wanted force while current goes through it"
        " (thesis section 2.2)."
    ),
    "isotonic_stand": (
        "Galvanostat and an actuator that carries weights, its displacement by an LVDT"
        " (thesis section 2.1)."
    ),
    "work_loop": (
        "Actuator under a periodic load whose length follows a loop by feedforward, learning and"
        " feedback (thesis sections 5.4, 6.2)."
    ),
    "degradation_watch": (
        "Galvanostat, an actuator that ages, and an estimator that lowers the voltage limit"
        " (thesis sections 4.2, 4.3)."
    ),
    "potentiostat_watch": (
        "Potentiostat that keeps an actuator at a voltage, and an estimator of its circuit (thesis"
        " section 4.3, fig. 4-8)."
    ),
    "protected_bench": (
        "Bench whose controller is switched off while the protection of a galvanostat holds the"
        " current of the actuator at zero (thesis section 4.2)."
    ),
    "foot_gait": (
        "Foot that moves under four actuators, each driven by its current (thesis chapter 5)."
    ),
    "hil_bench": (
        "Bench whose actuator is a real one: the member ``proxy`` stands for it and asks the rig"
        " (``ppy rig serve``)."
    ),
}
NAMES = tuple(SUMMARIES)
# of an actuator that an instrument drives and an estimator watches, which sets the voltage limit
_WATCHED = (
    "galvanostat.current -> actuator.current",
    "galvanostat.current -> estimator.current",
    "actuator.voltage -> estimator.voltage",
    "actuator.voltage -> galvanostat.voltage",
    "estimator.voltage_limit -> galvanostat.voltage_limit",
)


def system(name: str, runtime: str = "native") -> System:
    """Return one of the systems; its FMUs are built if they are not in the cache.

    Parameters
    ----------
    name : {"dma_bench", "isotonic_stand", "work_loop", "degradation_watch", \
"potentiostat_watch", "protected_bench", "foot_gait", "hil_bench"}
    runtime : {"native", "python"}
        Kind of build of its members.

    Raises
    ------
    UserError
        If there is no such system or runtime, or an FMU cannot be built.
    """
    makers = {
        "dma_bench": dma_bench,
        "isotonic_stand": isotonic_stand,
        "work_loop": work_loop,
        "degradation_watch": degradation_watch,
        "potentiostat_watch": potentiostat_watch,
        "protected_bench": protected_bench,
        "foot_gait": foot_gait,
        "hil_bench": hil_bench,
    }
    if name not in makers:
        raise UserError(f"no system named {name!r}{suggestion(name, makers)}")
    return makers[name](runtime)


def dma_bench(runtime: str) -> System:
    """Return the bench: a voice coil that keeps an actuator at a force (thesis section 2.2)."""
    return _make_bench("dma_bench", "actuator", "ppy_actuator_length_driven", runtime)


def hil_bench(runtime: str) -> System:
    """Return the bench with a proxy of a real actuator, which exchanges values with the rig.

    The proxy has the signals of the actuator, so that another FMU with the same signals can replace
    it.
    """
    bench = _make_bench("hil_bench", "proxy", "rig_proxy_length_driven", runtime)
    # each step needs an exchange with the rig, and a link can do 1 kHz
    return replace(bench, step=1e-3, stop=30.0)


def _make_bench(name: str, actuator: str, component_name: str, runtime: str) -> System:
    """Return the bench with a component in the place of the actuator, under a name of its own."""
    return System(
        name=name,
        members=(
            Member.of("bench", component("voice_coil_dma"), {"hold": 0.0}, runtime),
            Member.of(actuator, component(component_name), runtime=runtime),
        ),
        connections=connect(
            f"bench.position -> {actuator}.length_change", f"{actuator}.tension -> bench.tension"
        ),
        inputs={
            "force_reference": (Port("bench", "force_reference"),),
            "current": (Port(actuator, "current"),),
        },
        outputs=_make_outputs(
            f"{actuator}.tension", f"{actuator}.voltage", "bench.position", "bench.force_measured"
        ),
        doc=SUMMARIES[name],
        step=1e-4,  # at 1e-3 a Jacobi master overshoots by a fifth more
        stop=5.0,
    )


def isotonic_stand(runtime: str) -> System:
    """Return the stand: an actuator that carries weights and is driven by its current.

    The system is that of the thesis, section 2.1 and figs. 3-3 to 3-5.
    """
    return System(
        name="isotonic_stand",
        members=(
            Member.of("galvanostat", component("galvanostat"), _UNPROTECTED, runtime),
            Member.of("actuator", component("ppy_actuator"), runtime=runtime),
            Member.of("stand", component("isotonic_stand"), runtime=runtime),
        ),
        connections=connect(
            "galvanostat.current -> actuator.current",
            "actuator.voltage -> galvanostat.voltage",
            "stand.tension -> actuator.force",
            "actuator.displacement -> stand.displacement",
        ),
        inputs={
            "current_command": (Port("galvanostat", "current_command"),),
            "mass": (Port("stand", "mass"),),
            "zero": (Port("stand", "zero"),),
        },
        outputs=_make_outputs(
            "galvanostat.current",
            "actuator.voltage",
            "actuator.displacement",
            "stand.tension",
            "stand.displacement_measured",
        ),
        doc=SUMMARIES["isotonic_stand"],
        step=0.01,  # the period at which the galvanostat looks at the voltage
        stop=60.0,
    )


def work_loop(runtime: str) -> System:
    """Return an actuator that is to go round a loop of load and length (sections 5.4 and 6.2).

    The currents of feedforward and learning are added and pass through the feedback, whose limits
    hold for the sum. Each is switched by an input of its own: ``feedforward.active``,
    ``learning.learning``, and ``feedback.hold``. Length and load are given twice, now and as they
    are a sample of the feedforward later.
    """
    # the inverse of the nominal actuator, two samples ahead as a strain may lag, and a filter that
    # takes away the highest frequency
    lesson = {"learning": 1.0, "learning_gain": 2325.0, "lead": 2.0, "smoothing": 0.25}
    return System(
        name="work_loop",
        # in the order in which their commands are added at a sample
        members=(
            Member.of("feedforward", component("feedforward"), {"active": 1.0}, runtime),
            Member.of("learning", component("learning_controller"), lesson, runtime),
            Member.of("feedback", component("displacement_controller"), {"hold": 0.0}, runtime),
            Member.of("galvanostat", component("galvanostat"), _UNPROTECTED, runtime),
            Member.of("actuator", lagging_actuator(), runtime=runtime),
        ),
        connections=connect(
            "feedforward.command -> learning.feedback_command",
            "learning.command -> feedback.command_beside",
            "feedback.command -> galvanostat.current_command",
            "galvanostat.current -> actuator.current",
            "galvanostat.current -> feedback.current",
            "actuator.voltage -> galvanostat.voltage",
            "actuator.voltage -> feedback.voltage",
            "actuator.displacement -> feedback.displacement",
            "actuator.displacement -> learning.displacement",
        ),
        inputs={
            "force": (Port("actuator", "force"), Port("feedforward", "force")),
            "reference": (Port("feedback", "reference"), Port("learning", "reference")),
            "next_force": (Port("feedforward", "next_force"),),
            "next_reference": (Port("feedforward", "next_reference"),),
        },
        outputs=_make_outputs(
            "galvanostat.current",
            "actuator.voltage",
            "actuator.displacement",
            "actuator.charge",
            "feedback.limited",
        ),
        doc=SUMMARIES["work_loop"],
        step=0.01,  # the period at which the galvanostat looks at the voltage
        stop=50.0,
    )


def _make_outputs(*ports: str) -> dict[str, Port]:
    """Return outputs of a system, named after the variables."""
    pairs = [port.split(".") for port in ports]
    return {variable: Port(member, variable) for member, variable in pairs}


def degradation_watch(runtime: str) -> System:
    """Return an ageing actuator under an estimator that lowers its voltage limit.

    The system is that of the thesis, sections 4.2 and 4.3.
    """
    step = 0.1
    drive = {"protection_period": step, "control_period": step, "voltage_command": 0.0}
    films = {"C": capacitance()} | AGEING
    watch = {"sample_period": step} | ESTIMATOR
    return System(
        name="degradation_watch",
        # the estimator first: it samples before the protection acts on the same sample
        members=(
            Member.of("estimator", component("degradation_estimator"), watch, runtime),
            Member.of("galvanostat", component("galvanostat"), drive, runtime),
            Member.of("actuator", ageing_actuator(), films, runtime),
        ),
        connections=connect(*_WATCHED),
        inputs={
            "current_command": (Port("galvanostat", "current_command"),),
            "force": (Port("actuator", "force"),),
        },
        outputs=_make_outputs(
            "galvanostat.current",
            "actuator.voltage",
            "actuator.displacement",
            "estimator.voltage_limit",
        ),
        doc=SUMMARIES["degradation_watch"],
        step=step,
        stop=18000.0,
    )


def potentiostat_watch(runtime: str) -> System:
    """Return an actuator at a potentiostat, watched at 15 Hz by an estimator (thesis fig. 4-8).

    The potentiostat looks and acts a thousand times a second, so that it is as good as held between
    the samples of the estimator. Its gain is that of one step: what the voltage lacks is there at
    the next sample but for what the circuit lets go meanwhile.
    """
    period = 1e-3
    films: Any = component("ppy_actuator")()
    at_once = films.R1 * films.R2 / (films.R1 + films.R2)  # ohm, of the circuit for a step
    drive = {
        "potentiostat": 1.0,
        "protection_period": period,
        "control_period": period,
        "integral_gain": 1.0 / (at_once * period),
        "current_command": 0.0,
    }
    rate = 15.0  # Hz, as alpha and the resets of the thesis
    watch = {
        "sample_period": 1.0 / rate,
        "forgetting_time": 1.0,
        "remaining_weight": 0.985**rate,
        "reset_interval": 5.0,
        "initial_covariance": 1.0,
        "instrumental_variable": 0.0,
        "zero_order_hold": 0.0,
        "initial_voltage_limit": 15.0,
    }
    return System(
        name="potentiostat_watch",
        members=(
            Member.of("estimator", component("degradation_estimator"), watch, runtime),
            Member.of("galvanostat", component("galvanostat"), drive, runtime),
            Member.of("actuator", component("ppy_actuator"), runtime=runtime),
        ),
        connections=connect(*_WATCHED),
        inputs={
            "voltage_command": (Port("galvanostat", "voltage_command"),),
            "force": (Port("actuator", "force"),),
        },
        outputs=_make_outputs(
            "galvanostat.current", "actuator.voltage", "estimator.R1", "estimator.impedance"
        ),
        doc=SUMMARIES["potentiostat_watch"],
        step=period,
        stop=160.0,
    )


def protected_bench(runtime: str) -> System:
    """Return a bench whose controller rests while the protection has taken the current away.

    While the current is zero the films let their charge go, and the tension with it, which no force
    controller is to learn: its integral part stands still (thesis section 4.2).
    """
    bench = _make_bench("protected_bench", "actuator", "ppy_actuator_length_driven", runtime)
    drive = {"voltage_limit": 1.0, "voltage_command": 0.0}
    return replace(
        bench,
        members=(
            Member.of("galvanostat", component("galvanostat"), drive, runtime),
            *(
                replace(
                    member, parameters={k: v for k, v in member.parameters.items() if k != "hold"}
                )
                for member in bench.members
            ),
        ),
        connections=(
            *bench.connections,
            *connect(
                "galvanostat.current -> actuator.current",
                "actuator.voltage -> galvanostat.voltage",
                "galvanostat.recovering -> bench.hold",
            ),
        ),
        inputs={
            "force_reference": (Port("bench", "force_reference"),),
            "current_command": (Port("galvanostat", "current_command"),),
        },
        outputs=dict(bench.outputs) | _make_outputs("galvanostat.recovering", "bench.coil_voltage"),
        stop=20.0,
    )


def with_voltmeter(system: System, source: str, runtime: str = "native") -> System:
    """Return a system in which a voltage passes through a voltmeter before it is received.

    Parameters
    ----------
    system : System
    source : str
        Output ``member.variable``, in V; the inputs connected to it receive
        ``voltmeter.measured_voltage``.
    runtime : {"native", "python"}
        Kind of build of the voltmeter.

    Returns
    -------
    System
        It has another input, ``voltage_error`` in V: 0, or measurement noise.

    Raises
    ------
    UserError
        If there is no such member, or the voltmeter cannot be built.
    """
    port = system.port(source)
    measured = Port("voltmeter", "measured_voltage")
    moved = (replace(c, source=measured) if c.source == port else c for c in system.connections)
    return replace(
        system,
        members=(*system.members, Member.of("voltmeter", Voltmeter, runtime=runtime)),
        connections=(*moved, Connection(port, Port("voltmeter", "voltage"))),
        inputs={**system.inputs, "voltage_error": (Port("voltmeter", "error"),)},
    )


def lagging_actuator() -> type[Component]:
    """Return the actuator whose strain may lag and saturate; with its defaults it does neither."""
    return _actuator_with("strain_saturation", "strain_lag", name="lagging_actuator")


def ageing_actuator() -> type[Component]:
    """Return the actuator that warms up and whose series resistance grows with use."""
    return _actuator_with("resistance_growth", "self_heating", name="ageing_actuator")


def _actuator_with(*ids: str, name: str) -> type[Component]:
    """Return the force-driven actuator with effects of its catalogue."""
    known = effects("ppy_actuator")
    return stack(component("ppy_actuator"), *(known[one] for one in ids), name=name)


def periodic_voltage(R1: float, R2: float, C: float) -> float:
    """Return the largest voltage of a circuit in the periodic state under the square wave.

    The charge swings by ``tanh(T / (4 tau))`` of its final value.

    Parameters
    ----------
    R1, R2 : float
        In ohm.
    C : float
        In F.

    Returns
    -------
    float
        In V.
    """
    swing = tanh(1.0 / (4.0 * FREQUENCY * (R1 + R2) * C))
    return AMPLITUDE * R2 * (R1 + R2 * swing) / (R1 + R2)


def capacitance() -> float:
    """Return the capacitance in F at which the periodic voltage is the first one in the thesis.

    The other parameters are those of the fresh circuit of table 3-1.
    """
    from scipy.optimize import brentq

    fresh: Any = component("ppy_actuator")()

    def excess_voltage(C: float) -> float:
        return periodic_voltage(fresh.R1, fresh.R2, C) - FIRST_VOLTAGE

    return float(brentq(excess_voltage, 0.1, 100.0))


def foot_gait(runtime: str) -> System:
    """Return the foot under four actuators, each driven by its current (thesis chapter 5).

    Stiffness and damping in the compliance of the foot are those of the actuators beside it, and so
    is their tension: the compliance is what the toe yields under a force before actuators creep.
    """
    foot = taut_foot()
    actuator: Any = component("ppy_actuator_length_driven")
    film = actuator()
    tensions = balanced(foot())
    films = {"tension_stiffness_share": 1.0}
    films |= {f"k_{name}": film.k1 for name in FEET} | {f"b_{name}": film.b1 for name in FEET}
    members = [Member.of("foot", foot, films, runtime)]
    wires = []
    for name in FEET:
        # an actuator that has flowed to a shorter length than it is held at is under tension
        flow = {"maxwell_elongation_start": -tensions[name] / film.k1}
        members.append(Member.of(name, actuator, flow, runtime))
        wires.append(f"foot.{name}_length_change -> {name}.length_change")
        wires.append(f"{name}.tension -> foot.{name}_tension")
    currents = {f"{name}_current": (Port(name, "current"),) for name in FEET}
    forces = {f"toe_force_{axis}": (Port("foot", f"toe_force_{axis}"),) for axis in "xy"}
    return System(
        name="foot_gait",
        members=tuple(members),
        connections=connect(*wires),
        inputs=currents | forces,
        outputs=_make_outputs(
            "foot.ankle_angle", "foot.tm_angle", "foot.mtp_angle", "foot.toe_x", "foot.toe_y"
        ),
        doc=SUMMARIES["foot_gait"],
        step=1e-4,  # at 5e-4 a Jacobi master lets the toe oscillate ever more
        stop=2.0,
    )


def taut_foot() -> type[Component]:
    """Return the foot whose stiffness at the toe is also that of tensions on arms that change."""
    stiffened = effects("foot_dynamic")["tension_stiffness"]
    return stack(component("foot_dynamic"), stiffened, name="taut_foot")


def balanced(foot: Component) -> dict[str, float]:
    """Return tensions of the four actuators under which the foot rests in its reference position.

    Parameters
    ----------
    foot : Component
        A foot at zero joint angles, with the arms of its actuators as laws.

    Returns
    -------
    dict of str to float
        In N, by actuator.
    """
    tensions = dict(PRETENSION)
    for name, antagonist in _ANTAGONIST.items():
        arm = getattr(foot, f"{name}_arm")()
        antagonist_arm = getattr(foot, f"{antagonist}_arm")()
        tensions[antagonist] = -PRETENSION[name] * arm / antagonist_arm
    return tensions
