"""A user's model of a micromachined accelerometer, in um: under test, not the judge."""

from fmus.kit import Component, Input, Output, Parameter, State

UM = 1e6  # um in a metre


class Accelerometer(Component):
    """x'' = a - w0^2 x - (w0 / Q) x': proof mass on a spring in a gas film."""

    name = "mems_accelerometer"
    experiment = (0.05, 2.5e-5)

    omega0 = Parameter(1.5e4, "rad/s", min=1e2, max=1e6, nominal=1e4, doc="natural frequency")
    quality = Parameter(1.5, "1", min=0.01, max=1e4, doc="quality factor (Q)")

    shake = Input("m/s^2", nominal=50.0, doc="acceleration of the case (a)")
    travel = State("um", rate="travel_rate", nominal=0.2, doc="travel of the proof mass (x)")
    slip = State("um/s", rate="slip_rate", nominal=2e3, doc="its speed")

    def drive(self):
        """Acceleration of the case."""
        return UM * self.shake

    def spring(self):
        """Spring force over mass."""
        return self.omega0 * self.omega0 * self.travel

    def film(self):
        """Drag of the gas film over mass."""
        return self.omega0 / self.quality * self.slip

    def travel_rate(self):
        """Definition."""
        return self.slip

    def slip_rate(self):
        """Newton's second law in the frame of the case."""
        return self.drive() - self.spring() - self.film()

    @Output("um", nominal=0.2)
    def deflection(self):
        """As the capacitive bridge shows it."""
        return self.travel
