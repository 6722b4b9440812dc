"""The proxies of this project, with the signals of a component, a system or a calibration.

The proxy of another rig is declared in the same way, in a file of its own::

    from fmus.rig_proxy.proxy import Measured, Proxy
    from fmus.kit import Input

    class MyRig(Proxy):
        name = "my_rig"
        current = Input("A", doc="current into the actuator")
        voltage = Measured("V", doc="voltage across the actuator")
"""

from __future__ import annotations

from ..kit import Input, PowerPort
from .proxy import Measured, Proxy

# as at the component that a proxy takes the place of
_CIRCUIT = PowerPort("circuit", "electrical", "voltage", "current", ("p", "n"))


def _chain(length: str, force: str) -> PowerPort:
    """Return the port between the ends of the actuator."""
    return PowerPort("chain", "translational", length, force, ("flange_b", "flange_a"))


class _Actuator(Proxy):
    """Signals that both causalities share."""

    current = Input("A", doc="current into the actuator")
    voltage = Measured("V", doc="voltage across the actuator")
    electrochemical_displacement = Measured(
        "m", nominal=1e-4, display="mm", doc="elongation due to charge"
    )
    mechanical_displacement = Measured(
        "m", nominal=1e-4, display="mm", doc="elongation due to load"
    )
    charge = Measured("C", doc="charge on the polymer films")


class RigProxy(_Actuator):
    """The force-driven actuator of a real rig: the signals of ppy_actuator, measured."""

    name = "rig_proxy"
    ports = (_CIRCUIT, _chain("displacement", "force"))

    force = Input("N", doc="applied load, tension positive")
    displacement = Measured("m", nominal=1e-4, display="mm", doc="total elongation")


class RigProxyLengthDriven(_Actuator):
    """The length-driven actuator of a real rig: the signals of ppy_actuator_length_driven,
    measured.
    """

    name = "rig_proxy_length_driven"
    ports = (_CIRCUIT, _chain("length_change", "tension"))

    length_change = Input(
        "m", nominal=1e-4, display="mm", doc="imposed total elongation from the unloaded length"
    )
    tension = Measured("N", doc="tension in the actuator")


class RigProxyBench(Proxy):
    """The whole test bench with its force loop and the actuator on it: the signals of the system
    dma_bench, measured.
    """

    name = "rig_proxy_bench"
    ports = (_CIRCUIT,)

    force_reference = Input("N", doc="wanted force")
    current = Input("A", doc="current into the actuator")
    tension = Measured("N", doc="tension in the actuator")
    voltage = Measured("V", doc="voltage across the actuator")
    position = Measured("m", nominal=1e-3, display="mm", doc="position of the coil")
    force_measured = Measured("N", doc="force as the computer reads it")


class RigProxyThesis(Proxy):
    """The analyzer of the thesis without its force loop: the signals of the calibration thesis."""

    name = "rig_proxy_thesis"
    ports = (_CIRCUIT,)

    current = Input("A", doc="current into the actuator")
    force = Input("N", doc="force of the voice coil, open loop")
    force_measured = Measured("N", doc="force at the load cell")
    displacement = Measured("m", nominal=1e-3, display="mm", doc="position of the coil")
    voltage = Measured("V", doc="voltage across the actuator")


class RigProxyThesisGenerator(Proxy):
    """The actuator behind a function generator and a galvanostat: the signals of the calibration
    thesis_generator.
    """

    name = "rig_proxy_thesis_generator"
    ports = (_CIRCUIT,)

    current = Input("A", doc="current into the actuator")
    voltage = Measured("V", doc="voltage across the actuator")
