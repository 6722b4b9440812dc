"""A model whose laws are corrected, in a module that an FMU can take along."""

from fmus.kit import Component, Input, Output, Parameter, State


class Plain(Component):
    """Outputs that are laws of one input, so that what is added to one can be read off."""

    name = "plain"

    factor = Parameter(2.0, "1", min=-1e6, max=1e6)
    drive = Input("V", nominal=2.0)
    level = State("V*s", rate="fill", start=0.5)

    def fill(self):
        """Rate of the level."""
        return self.drive

    def base(self):
        """Law that a correction changes."""
        return self.factor + self.drive

    def squared(self):
        """Of another law."""
        return self.drive * self.drive

    def scaled(self, x):
        """With an argument."""
        return self.factor * x

    def pair(self):
        """Two numbers."""
        return self.drive, self.level

    def of_base(self):
        """Computed from what is corrected."""
        return 2.0 * self.base()

    def ratio(self):
        """Of no value at the defaults."""
        return 1.0 / self.drive

    @Output("V")
    def seen(self):
        """The law."""
        return self.base()

    @Output("V")
    def other(self):
        """Another, twice."""
        return self.scaled(self.drive) + self.scaled(1.0)

    @Output("V")
    def doubled(self):
        """Twice the law."""
        return self.of_base() + self.pair()[0]
