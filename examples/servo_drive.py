"""A family of drives: a DC motor, or a servo motor seen in one axis, and what it turns.

``ServoDrive`` has winding, induced voltage and one rigid inertia with viscous friction;
``ElasticDrive`` turns its load by a shaft that twists. Dry friction, a load that pulls to one side,
a fan and a winding that warms are effects, which a diagnosis tries and any command lays over either
drive::

    ppy diagnose record.csv --model examples/servo_drive.py:ServoDrive
    ppy design examples/servo_drive.py:ServoDrive --with coulomb_friction --command voltage
    --measured speed --sample-period 5ms --out loop
"""

from fmus.kit import Component, Effect, Input, Output, Parameter, State, absolute
from fmus.kit.generic import coulomb_friction, force_offset


class ServoDrive(Component):
    """Voltage in, speed out: u = R i + K w, J dw/dt = K i - d w - M."""

    name = "servo_drive"
    experiment = (20.0, 0.01)

    resistance = Parameter(2.0, "ohm", min=1e-6, max=1e6, doc="of the winding, cold (R)")
    constant = Parameter(
        0.05, "N*m/A", min=1e-9, max=1e6, nominal=0.05, doc="torque per current (K)"
    )
    inertia = Parameter(4e-4, "kg*m^2", min=1e-12, max=1e6, nominal=4e-4, doc="of the rotor (J)")
    damping = Parameter(2e-4, "N*m*s", min=0, max=1e6, nominal=2e-4, doc="viscous friction (d)")

    voltage = Input("V", nominal=5.0, doc="voltage at the winding (u)")
    load_torque = Input("N*m", nominal=0.05, doc="torque of what is driven, against the motor (M)")
    velocity = State("rad/s", rate="acceleration", nominal=100.0, doc="speed of the rotor (w)")

    def winding_resistance(self):
        """Resistance of the winding as it is now."""
        return self.resistance

    def winding_current(self):
        """Ohm's law, with what the motor induces."""
        return (self.voltage - self.constant * self.velocity) / self.winding_resistance()

    def friction(self):
        """Torque of bearings and air."""
        return self.damping * self.velocity

    def shaft_torque(self):
        """Torque that the rotor delivers."""
        return self.load_torque

    def acceleration(self):
        """Balance of torques."""
        driving = self.constant * self.winding_current()
        return (driving - self.friction() - self.shaft_torque()) / self.inertia

    @Output("A", nominal=1.0)
    def current(self):
        """Winding current, as measured."""
        return self.winding_current()

    @Output("rad/s", nominal=100.0)
    def speed(self):
        """Speed of the rotor, as measured."""
        return self.velocity


class ElasticDrive(ServoDrive):
    """A drive whose load hangs on a shaft that twists: M_s = c phi + b dphi/dt."""

    name = "elastic_drive"
    experiment = (5.0, 0.001)

    load_inertia = Parameter(
        1e-3, "kg*m^2", min=1e-12, max=1e6, nominal=1e-3, doc="inertia of the load"
    )
    stiffness = Parameter(5.0, "N*m", min=1e-6, max=1e9, doc="torque per twist of the shaft (c)")
    shaft_damping = Parameter(
        1e-3, "N*m*s", min=0, max=1e6, nominal=1e-3, doc="damping of the shaft (b)"
    )

    load_velocity = State(
        "rad/s", rate="load_acceleration", nominal=100.0, output=True, doc="speed of the load"
    )
    twist = State("rad", rate="twist_rate", nominal=0.01, doc="twist of the shaft (phi)")

    def twist_rate(self):
        """Difference of the speeds."""
        return self.velocity - self.load_velocity

    def shaft_torque(self):
        """Torque of the shaft."""
        return self.stiffness * self.twist + self.shaft_damping * self.twist_rate()

    def load_acceleration(self):
        """Balance of torques at the load."""
        return (self.shaft_torque() - self.load_torque) / self.load_inertia


class Fan(Effect):
    """Friction that grows with the square of the speed, as of air; 0 is the base model."""

    id = "fan"
    title = "Drag of air"
    neutral = "fan_torque"
    assumption = "friction is viscous"

    fan_torque = Parameter(
        0.0, "N*m*s^2", min=0, max=1, nominal=1e-6, doc="torque per speed squared"
    )

    def friction(self):
        """Torque of bearings and air, with what grows faster than the speed."""
        return super().friction() + self.fan_torque * self.velocity * absolute(self.velocity)


class WindingHeat(Effect):
    """Resistance that rises as the current warms the winding; a rise of 0 is the base model.

    The copper's loss is the input of one thermal time constant.
    """

    id = "winding_heat"
    title = "A winding that warms"
    neutral = "heating"
    assumption = "the resistance of the winding is constant"

    heating = Parameter(
        0.0, "1/A^2", min=0, max=10, nominal=0.05, doc="rise of the resistance per current squared"
    )
    warming_time = Parameter(60.0, "s", min=1e-2, max=1e5, nominal=60.0, doc="of the winding")
    heating_current = State(
        "A^2", rate="warming", nominal=1.0, doc="current squared, as the winding remembers it"
    )

    def warming(self):
        """Rate of what the winding remembers."""
        return (self.winding_current() ** 2 - self.heating_current) / self.warming_time

    def winding_resistance(self):
        """Resistance of the winding as it is now, warm."""
        return super().winding_resistance() * (1.0 + self.heating * self.heating_current)


DryFriction = coulomb_friction(ServoDrive, "friction", "velocity", "N*m", 0.01)
LoadOffset = force_offset(ServoDrive, "friction", "N*m", 0.01)
EFFECTS = {effect.id: effect for effect in (DryFriction, LoadOffset, Fan, WindingHeat)}
