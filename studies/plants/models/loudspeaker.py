"""A user's model of a woofer in free air, in mm: under test, not the judge."""

from fmus.kit import Component, Input, Output, Parameter, State

MM = 1e3  # mm in a metre


class Loudspeaker(Component):
    """Voice coil without inductance on a mass, a suspension and losses (Thiele and Small)."""

    name = "woofer"
    experiment = (1.0, 5e-4)

    Re = Parameter(6.0, "ohm", min=0.1, max=100, doc="resistance of the coil")
    Bl = Parameter(6.0, "N/A", min=0.01, max=100, doc="force factor")
    Mms = Parameter(15e-3, "kg", min=1e-5, max=1, nominal=0.01, doc="moving mass")
    Rms = Parameter(1.2, "N*s/m", min=0, max=100, doc="mechanical losses")
    Kms = Parameter(1.2, "N/mm", min=1e-3, max=1e3, doc="stiffness")

    amplifier = Input("V", nominal=6.0, doc="voltage at the terminals")
    cone = State("mm", rate="cone_rate", nominal=5.0, doc="excursion of the cone")
    cone_speed = State("m/s", rate="cone_acceleration", nominal=0.5, doc="speed of the cone")

    def coil(self):
        """Ohm's law, with what the cone induces."""
        return (self.amplifier - self.Bl * self.cone_speed) / self.Re

    def suspension(self):
        """Force of spider and surround."""
        return self.Kms * self.cone

    def losses(self):
        """Force that is lost."""
        return self.Rms * self.cone_speed

    def cone_rate(self):
        """Definition."""
        return MM * self.cone_speed

    def cone_acceleration(self):
        """Balance of forces."""
        return (self.Bl * self.coil() - self.suspension() - self.losses()) / self.Mms

    @Output("A")
    def current(self):
        """By a shunt."""
        return self.coil()

    @Output("mm", nominal=5.0)
    def excursion(self):
        """By a laser."""
        return self.cone
