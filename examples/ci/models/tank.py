"""A tank that is filled through a valve and drains through a pipe, as an FMU of pythonfmu."""

from math import exp

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Tank(Fmi2Slave):
    """A lag of first order: ``time_constant * d(level)/dt = gain * valve - level``."""

    author = "A user"
    description = "A tank that drains"

    def __init__(self, **kwargs):
        """Declare the variables."""
        super().__init__(**kwargs)
        self.valve = 0.0
        self.level = 0.0
        self.gain = 0.8
        self.time_constant = 2.0
        parameter = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.tunable}
        self.register_variable(Real("valve", causality=Fmi2Causality.input))
        self.register_variable(Real("level", causality=Fmi2Causality.output))
        self.register_variable(Real("gain", **parameter))
        self.register_variable(Real("time_constant", **parameter))

    def do_step(self, current_time, step_size):
        """Step exactly: the valve is held."""
        settled = self.gain * self.valve
        self.level = settled + (self.level - settled) * exp(-step_size / self.time_constant)
        return True
