"""Models of systems that nothing drives, as an engineer writes them first: too simple ones."""

from fmus.kit import Component, Output, Parameter, State, sin


class Pendulum(Component):
    """J ddtheta/dt = -W sin(theta) - d dtheta/dt."""

    name = "free_pendulum"
    experiment = (20.0, 0.02)

    inertia = Parameter(0.05, "kg*m^2", min=1e-9, max=1e6, doc="inertia about the hinge (J)")
    weight = Parameter(1.5, "N*m", min=1e-9, max=1e6, doc="torque of the weight, horizontal (W)")
    damping = Parameter(0.004, "N*m*s", min=0, max=1e6, doc="viscous friction of the hinge (d)")

    theta = State("rad", rate="theta_rate", doc="angle from hanging")
    velocity = State("rad/s", rate="acceleration", doc="angular velocity")

    def friction(self):
        """Torque of friction."""
        return self.damping * self.velocity

    def gravity(self):
        """Torque of the weight."""
        return self.weight * sin(self.theta)

    def theta_rate(self):
        """Definition."""
        return self.velocity

    def acceleration(self):
        """Balance of torques."""
        return -(self.gravity() + self.friction()) / self.inertia

    @Output("rad")
    def angle(self):
        """Angle as measured."""
        return self.theta


class Car(Component):
    """m dv/dt = -F - c v."""

    name = "coasting_car"
    experiment = (90.0, 0.1)

    mass = Parameter(1200.0, "kg", min=1.0, max=1e6, doc="mass (m)")
    rolling = Parameter(130.0, "N", min=0, max=1e6, doc="rolling resistance (F)")
    viscous = Parameter(6.0, "N*s/m", min=0, max=1e6, doc="friction that grows with speed (c)")

    v = State("m/s", rate="acceleration", nominal=10.0, doc="speed")

    def resistance(self):
        """Force that brakes."""
        return self.rolling + self.viscous * self.v

    def acceleration(self):
        """Newton."""
        return -self.resistance() / self.mass

    @Output("m/s")
    def speed(self):
        """Speed as measured."""
        return self.v


class Capacitor(Component):
    """C dv/dt = -v / R."""

    name = "discharged_capacitor"
    experiment = (40.0, 0.05)

    capacitance = Parameter(1e-3, "F", min=1e-12, max=1e6, doc="capacitance (C)")
    resistance = Parameter(20e3, "ohm", min=1e-6, max=1e12, doc="load (R)")

    v = State("V", rate="slope", start=10.0, doc="voltage")

    def current(self):
        """Give the current of the load."""
        return self.v / self.resistance

    def slope(self):
        """Charge that leaves."""
        return -self.current() / self.capacitance

    @Output("V")
    def voltage(self):
        """Voltage as measured."""
        return self.v


class Cooling(Component):
    """C dT/dt = -G (T - T_room)."""

    name = "cooling_body"
    experiment = (5400.0, 6.0)

    capacity = Parameter(900.0, "J/K", min=1e-3, max=1e9, doc="heat capacity (C)")
    conductance = Parameter(0.5, "W/K", min=1e-6, max=1e6, doc="conductance to the room (G)")
    room = Parameter(293.15, "K", min=1.0, max=1e4, doc="temperature of the room")

    body = State("K", rate="slope", start=500.0, nominal=100.0, doc="temperature of the body")

    def loss(self):
        """Heat that leaves."""
        return self.conductance * (self.body - self.room)

    def slope(self):
        """Balance of heat."""
        return -self.loss() / self.capacity

    @Output("K")
    def temperature(self):
        """Temperature as measured."""
        return self.body


class Torsion(Component):
    """J ddphi/dt = -k phi - d dphi/dt."""

    name = "torsion_balance"
    experiment = (12.0, 0.01)

    inertia = Parameter(2e-3, "kg*m^2", min=1e-12, max=1e6, doc="inertia (J)")
    stiffness = Parameter(0.3, "N*m/rad", min=1e-9, max=1e6, doc="of the wire (k)")
    damping = Parameter(4e-4, "N*m*s/rad", min=0, max=1e6, doc="of the air (d)")

    phi = State("rad", rate="phi_rate", doc="twist")
    velocity = State("rad/s", rate="acceleration", doc="its rate")

    def restoring(self):
        """Torque of the wire."""
        return self.stiffness * self.phi

    def drag(self):
        """Torque of the air."""
        return self.damping * self.velocity

    def phi_rate(self):
        """Definition."""
        return self.velocity

    def acceleration(self):
        """Balance of torques."""
        return -(self.restoring() + self.drag()) / self.inertia

    @Output("rad")
    def twist(self):
        """Twist as measured."""
        return self.phi


class Recovery(Component):
    """strain = e + permanent, de/dt = -e / T."""

    name = "creep_recovery"
    experiment = (600.0, 0.5)

    retardation_time = Parameter(40.0, "s", min=1e-6, max=1e9, doc="time constant (T)")
    permanent = Parameter(0.002, "1", min=-1.0, max=1.0, doc="strain that stays")

    delayed = State("1", rate="recovery", start=0.01, nominal=0.01, doc="strain of the element")

    def recovery(self):
        """Rate at which the element recovers."""
        return -self.delayed / self.retardation_time

    @Output("1")
    def strain(self):
        """Strain as measured."""
        return self.delayed + self.permanent
