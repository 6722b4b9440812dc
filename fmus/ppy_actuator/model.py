"""The polypyrrole actuator: RC charging, Burgers viscoelasticity, charge-to-displacement coupling.

Thesis chapter 3, eqs. 3.1-3.9 and fig. 3-1. Charge does not depend on load, nor creep on charge;
the two displacements add (assumptions 1 and 5). The mechanical parameters are those of fig. 3-9 in
N/m and N s/m; the printed N/mm is an error of the source (``docs/errata.md``, row 1).

An output returns the value of a law, and no law calls an output, so that an error of measurement
can be added to an output without changing the physics.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ..kit import Component, Input, Output, Parameter, PowerPort, Preset, State, maximum

_CIRCUIT = PowerPort("circuit", "electrical", "voltage", "current", ("p", "n"))
_CHAIN = PowerPort("chain", "translational", "displacement", "force", ("flange_b", "flange_a"))
_CHAIN_AT_LENGTH = replace(_CHAIN, potential="length_change", flow="tension")
_TABLE = "thesis table 3-1, mean of three 12-layer data sets"
_FIGURE = "thesis fig. 3-9, 12-layer actuator 106, in N/m and N*s/m (errata 1)"


class Actuator(Component):
    """Laws that all causalities share: parts of the circuit, creep elements and coupling."""

    R1 = Parameter(
        0.43,
        "ohm",
        min=0,
        max=1e6,
        source=_TABLE,
        title="series resistance",
        doc="series resistance: ion diffusion, contacts and electrolyte",
    )
    R2 = Parameter(
        2.35,
        "ohm",
        min=1e-6,
        max=1e12,
        source=_TABLE,
        title="leakage resistance",
        doc="leakage resistance across R1 and C",
    )
    C = Parameter(
        2.70,
        "F",
        min=1e-9,
        max=1e9,
        source=_TABLE,
        title="capacitance",
        doc="bulk capacitance of the polymer films",
    )
    alpha = Parameter(
        6.8e-5,
        "m/C",
        min=-1.0,
        max=1.0,
        display="mm/C",
        source="thesis fig. 3-10",
        title="displacement per charge",
        doc="displacement per charge",
    )
    k1 = Parameter(
        6300.0,
        "N/m",
        min=1e-6,
        max=1e15,
        source=_FIGURE,
        title="instantaneous stiffness",
        doc="instantaneous (Maxwell) stiffness",
    )
    b1 = Parameter(
        1.7e6,
        "N*s/m",
        min=1e-6,
        max=1e18,
        source=_FIGURE,
        title="viscous damping",
        doc="viscous flow (Maxwell) damping",
    )
    k2 = Parameter(
        1.0e4,
        "N/m",
        min=1e-6,
        max=1e15,
        source=_FIGURE,
        title="delayed stiffness",
        doc="delayed (Kelvin) stiffness",
    )
    b2 = Parameter(
        2.0e6,
        "N*s/m",
        min=1e-6,
        max=1e18,
        source=_FIGURE,
        title="delayed damping",
        doc="delayed (Kelvin) damping",
    )

    force_limit = Parameter(
        3.0,
        "N",
        min=0,
        max=1e9,
        source="thesis table 2-1: permanent deformation above approximately 3 N",
        fitted=False,
        tunable=True,
        doc="load above which the films deform for good",
    )
    compression_limit = Parameter(
        0.0,
        "N",
        min=0,
        max=1e9,
        source="thesis section 3.1.2: used in tension only, films buckle under small compression",
        fitted=False,
        tunable=True,
        doc="compression above which the films are slack",
    )
    displacement_limit = Parameter(
        7e-3,
        "m",
        min=0,
        max=1e3,
        nominal=1e-3,
        display="mm",
        source="thesis table 2-1: the maximum displacement is approximately 7 mm",
        fitted=False,
        tunable=True,
        doc="elongation, of either sign, that the actuator does not reach",
    )
    voltage_limit = Parameter(
        1.5,
        "V",
        min=0,
        max=1e6,
        source="choice, V_max of degradation_estimator; thesis section 4.2 has no number",
        fitted=False,
        tunable=True,
        doc="voltage, of either sign, at which the oxidation of the films is near",
    )

    charge = State("C", rate="capacitor_current", output=True, doc="charge on the polymer films")
    kelvin_elongation = State(
        "m",
        rate="kelvin_rate",
        nominal=1e-4,
        display="mm",
        doc="elongation of the Kelvin element (x_b2)",
    )
    maxwell_elongation = State(
        "m",
        rate="maxwell_rate",
        nominal=1e-4,
        display="mm",
        doc="elongation of the Maxwell dashpot (x_b1)",
    )

    # --- electrical
    # ----------------------------------------------------------------------------------------------

    def capacitance(self) -> Any:
        """Bulk capacitance C of the films in F (fig. 3-1)."""
        return self.C

    def film_voltage(self) -> Any:
        """Voltage of the charged films, Q / C (fig. 3-1)."""
        return self.charge / self.capacitance()

    def capacitor_voltage(self) -> Any:
        """Voltage behind the immediate resistance, here that of the films (fig. 3-1)."""
        return self.film_voltage()

    def series_resistance(self) -> Any:
        """Resistance in series with the films, R1 (fig. 3-1)."""
        return self.R1

    def immediate_resistance(self) -> Any:
        """Part of the series resistance without memory: all of R1 in the base model (fig. 3-1)."""
        return self.series_resistance()

    # Each causality solves the circuit for its unknowns: charging current of the films, voltage
    # across R1 and C in series, and total current including that through R2.
    capacitor_current: Callable[[], Any]
    terminal_voltage: Callable[[], Any]
    drawn_current: Callable[[], Any]

    # --- coupling
    # ----------------------------------------------------------------------------------------------

    def charge_elongation(self, charge: Any) -> Any:
        """Elongation due to charge, alpha Q (eq. 3.4)."""
        return self.alpha * charge

    # --- mechanical
    # ----------------------------------------------------------------------------------------------

    # Force through every element of the series chain, tension positive: set by the causality.
    load: Callable[[], Any]

    def kelvin_force(self) -> Any:
        """Force of the Kelvin spring, k2 x_b2 (fig. 3-1)."""
        return self.k2 * self.kelvin_elongation

    def kelvin_rate(self) -> Any:
        """Creep rate of the Kelvin element, second row of eq. 3.5; its time constant is b2 / k2
        (eq. 3.1).
        """
        return (self.load() - self.kelvin_force()) / self.b2

    def flow_force(self) -> Any:
        """Force under which the Maxwell dashpot flows: all of the load (fig. 3-1)."""
        return self.load()

    def maxwell_rate(self) -> Any:
        """Flow rate of the Maxwell dashpot, third row of eq. 3.5; its slope under constant load
        gives b1 (eq. 3.3).
        """
        return self.flow_force() / self.b1

    def creep(self) -> Any:
        """Elongation of all elements but the instantaneous spring, x_b1 + x_b2 (eq. 3.5)."""
        return self.kelvin_elongation + self.maxwell_elongation

    def spring_elongation(self, load: Any) -> Any:
        """Instantaneous elongation x_0 = F / k1 (eq. 3.2)."""
        return load / self.k1

    def spring_force(self, elongation: Any) -> Any:
        """Inverse of :meth:`spring_elongation`: F = k1 x_0 (eq. 3.2)."""
        return self.k1 * elongation

    def chain_elongation(self) -> Any:
        """Elongation of the whole chain, x_b1 + x_b2 + F/k1 (eqs. 3.5 and 3.7)."""
        return self.creep() + self.spring_elongation(self.load())

    presets = {
        "five_layer": Preset(
            {
                "R1": 1.32,
                "R2": 2.72,
                "C": 0.46,
                "k1": 6300.0 * 5 / 12,
                "b1": 1.7e6 * 5 / 12,
                "k2": 1.0e4 * 5 / 12,
                "b2": 2.0e6 * 5 / 12,
            },
            doc=(
                "5-layer actuator: circuit as measured (thesis section 3.3.1, fig. 3-5); stiffness"
                " and damping are the 12-layer values times 5/12, because parallel films add"
                " (section 3.1.2); alpha is kept"
            ),
        ),
    }


class CurrentDriven(Actuator):
    """Laws of the circuit solved for the voltage, driven by a galvanostat (section 2.3)."""

    current = Input("A", doc="current into the actuator")

    def drawn_current(self) -> Any:
        """Current of the instrument, the input of this causality."""
        return self.current

    def supply_current(self) -> Any:
        """Current into the circuit of fig. 3-1: all of the input in the base model."""
        return self.current

    def capacitor_current(self) -> Any:
        """Charging current, first row of eq. 3.5: dQ/dt = (R2 i - Q/C) / (R1 + R2)."""
        return (self.R2 * self.supply_current() - self.capacitor_voltage()) / (
            self.immediate_resistance() + self.R2
        )

    def terminal_voltage(self) -> Any:
        """Voltage over R1 and C in series; its transfer function from the current is eq. 3.9."""
        return self.immediate_resistance() * self.capacitor_current() + self.capacitor_voltage()

    @Output("V")
    def voltage(self) -> Any:
        """Voltage across the actuator (eq. 3.9)."""
        return self.terminal_voltage()


class VoltageDriven(Actuator):
    """Laws of the circuit solved for the current, driven by a potentiostat (section 2.3).

    The difference between terminal and film voltage lies across R1, so that the current is an
    explicit function of voltage and states.
    """

    R1 = Parameter(
        0.43,
        "ohm",
        min=1e-6,
        max=1e6,
        source=_TABLE,
        title="series resistance",
        doc="series resistance: ion diffusion, contacts and electrolyte; it limits the current",
    )
    voltage = Input("V", doc="voltage across the actuator")

    def terminal_voltage(self) -> Any:
        """Voltage across the actuator, the input of this causality."""
        return self.voltage

    def capacitor_current(self) -> Any:
        """Charging current, eq. 3.9 solved for it: dQ/dt = (V - Q/C) / R1."""
        return (self.terminal_voltage() - self.capacitor_voltage()) / self.immediate_resistance()

    def drawn_current(self) -> Any:
        """Sum of the charging current and of the leakage through R2 (fig. 3-1)."""
        return self.capacitor_current() + self.terminal_voltage() / self.R2

    @Output("A")
    def current(self) -> Any:
        """Current into the actuator, dQ/dt + V / R2 (eqs. 3.5 and 3.9)."""
        return self.drawn_current()


class Elongating(Actuator):
    """Outputs of the elongation, common to all causalities."""

    @Output("m", nominal=1e-4, display="mm")
    def electrochemical_displacement(self) -> Any:
        """Elongation due to charge, alpha Q (eq. 3.4)."""
        return self.charge_elongation(self.charge)

    @Output("m", nominal=1e-4, display="mm")
    def mechanical_displacement(self) -> Any:
        """Elongation due to load, x_b1 + x_b2 + F/k1 (eqs. 3.5 and 3.7)."""
        return self.chain_elongation()


class ForceDriven(Elongating):
    """Laws of the mechanical chain under a given load."""

    force = Input(
        "N", doc="applied load, tension positive; films buckle under compression (assumption 3)"
    )

    def load(self) -> Any:
        """Load of the chain, the input ``force``."""
        return self.force

    @Output("m", nominal=1e-4, display="mm")
    def displacement(self) -> Any:
        """Total elongation, the sum of both (eq. 3.8)."""
        return self.charge_elongation(self.charge) + self.chain_elongation()

    @Output("N", measured=False)
    def compression_margin(self) -> Any:
        """Compression that is left to ``compression_limit``; negative where the films are slack."""
        return self.compression_limit + self.load()

    @Output("m", nominal=1e-3, display="mm", measured=False)
    def displacement_margin(self) -> Any:
        """Elongation of either sign that is left to ``displacement_limit``."""
        elongation = self.charge_elongation(self.charge) + self.chain_elongation()
        return self.displacement_limit - abs(elongation)


class LengthDriven(Elongating):
    """Laws of the mechanical chain at a given length.

    Only the spring k1 responds without delay: its elongation is the imposed length change less
    creep and the elongation due to charge.
    """

    length_change = Input(
        "m", nominal=1e-4, display="mm", doc="imposed total elongation from the unloaded length"
    )

    limits = {"load": "taut_load"}

    def taut_load(self) -> Any:
        """Force of the spring k1 at its elongation; negative where the chain is slack (eq. 3.8)."""
        elongation = self.length_change - self.charge_elongation(self.charge) - self.creep()
        return self.spring_force(elongation)

    def load(self) -> Any:
        """Load of the chain, zero while it is slack (assumption 3)."""
        return maximum(self.taut_load(), 0.0)

    @Output("N")
    def tension(self) -> Any:
        """Tension in the actuator; slack instead of compression (assumption 3)."""
        return self.load()

    @Output("N", measured=False)
    def compression_margin(self) -> Any:
        """Compression that is left to ``compression_limit``, of the chain as if it could push;
        negative where the films are slack.
        """
        return self.compression_limit + self.taut_load()

    @Output("m", nominal=1e-3, display="mm", measured=False)
    def displacement_margin(self) -> Any:
        """Elongation of either sign that is left to ``displacement_limit``."""
        return self.displacement_limit - abs(self.length_change)


class Watched(Actuator):
    """Margins to the limits of the material, beyond which the laws are not valid.

    A margin is the limit less the value, negative beyond it: ``force_margin`` is the distance to
    ``force_limit``.
    """

    @Output("N", measured=False)
    def force_margin(self) -> Any:
        """Load that is left to ``force_limit``."""
        return self.force_limit - self.load()

    @Output("V", measured=False)
    def voltage_margin(self) -> Any:
        """Voltage of either sign that is left to ``voltage_limit``."""
        return self.voltage_limit - abs(self.terminal_voltage())


class PpyActuator(Watched, ForceDriven, CurrentDriven):
    """Force-driven actuator: current and load in, voltage and displacement out
    (thesis eqs. 3.1-3.9).
    """

    name = "ppy_actuator"
    ports = (_CIRCUIT, _CHAIN)


class PpyActuatorVoltageDriven(Watched, ForceDriven, VoltageDriven):
    """Voltage-driven actuator: voltage and load in, current and displacement out."""

    name = "ppy_actuator_voltage_driven"
    ports = (_CIRCUIT, _CHAIN)


class PpyActuatorLengthDriven(Watched, LengthDriven, CurrentDriven):
    """Length-driven actuator: the same laws with current and length in, tension and voltage out."""

    name = "ppy_actuator_length_driven"
    ports = (_CIRCUIT, _CHAIN_AT_LENGTH)
