"""Known ways in which a tank is wrong."""

from fmus.kit import Effect, Parameter, sqrt


class Turbulence(Effect):
    """Part of the flow grows with the square root of the level; a share of 0 is the base model."""

    id = "turbulence"
    neutral = "share"
    assumption = "the flow is laminar"

    share = Parameter(0.0, "1", min=0, max=1, doc="share of the turbulent law")
    usual = Parameter(1.0, "m", min=1e-3, max=1e3, doc="level at which both laws agree")

    def pipe_flow(self):
        """Flow of both laws."""
        turbulent = self.conductance * sqrt(self.usual * (self.level + 1e-6))
        return (1 - self.share) * super().pipe_flow() + self.share * turbulent


EFFECTS = {"turbulence": Turbulence}
