"""Backend with an emulated rig, in real time or in lockstep."""

from __future__ import annotations

import time
from collections.abc import Mapping

from demonstrations.emulator import DISPLACEMENT, VOLTAGE, RigParameters
from demonstrations.emulator.stepping import (
    DEVIATIONS,
    BenchPlant,
    ForceDriven,
    LengthDriven,
    Noise,
    Plant,
    SteppedRig,
    hidden_effect,
)
from fmus.kit import UserError
from orchestration.rig import (
    KNOWN_LIMITS,
    SIGNALS,
    UNITS,
    checked_step,
    commands,
    integer,
    one_of,
)
from orchestration.rig.backends import Limit, Steppable

_TICK = 1e-4  # s; real time passes in whole ticks, whose transitions come again
_LONGEST = 60.0  # s, of one step
_GAP = 2.0  # s; longer pauses of this process count as this long
_PLANTS: Mapping[str, type[ForceDriven] | type[LengthDriven] | type[BenchPlant]] = {
    "force-driven": ForceDriven,
    "length-driven": LengthDriven,
    "bench": BenchPlant,
}


class Emulator(Steppable):
    """An emulated rig, at rest when it is opened.

    Its time starts with the first :meth:`write`. It is real time, and every :meth:`read` advances
    the rig to the present, until :meth:`advance` is called first; then only that advances the rig.

    Parameters
    ----------
    signals : {"force-driven", "length-driven", "bench"}
    seed : str
        Whole number, the seed of noise, hidden effect and specimen.
    hidden : str
        ``none``, ``drawn`` by the seed, or the id of an effect of the actuator's catalogue.
    noise : {"on", "off"}
    specimen : {"nominal", "drawn"}
        The thesis's 12-layer actuator, or one with parameters drawn about its own.

    Raises
    ------
    UserError
        If an option has a value that is not allowed.
    """

    @classmethod
    def devices(cls, **options: str) -> list[str]:
        """Return an empty list: there may be any number of emulated rigs."""
        return []

    def __init__(
        self,
        signals: str = "force-driven",
        seed: str = "0",
        hidden: str = "none",
        noise: str = "on",
        specimen: str = "nominal",
    ) -> None:
        chosen = SIGNALS[one_of("signals", signals, _PLANTS)]
        number = integer("seed", seed)
        self.inputs = {name: UNITS[name] for name in chosen.inputs}
        self.outputs = {name: UNITS[name] for name in chosen.outputs}
        self.limits: Mapping[str, Limit] = {
            name: KNOWN_LIMITS[name]
            for name in (*chosen.inputs, *chosen.outputs)
            if name in KNOWN_LIMITS
        }
        one_of("noise", noise, ("on", "off"))
        drawn = one_of("specimen", specimen, ("nominal", "drawn")) == "drawn"
        sensed = tuple(name for name in (VOLTAGE, DISPLACEMENT) if name in self.outputs)
        try:
            self._hidden = hidden_effect(hidden, number, sensed)
        except ValueError as error:
            raise UserError(f"option hidden: {error}") from error
        parameters = RigParameters.scattered(number) if drawn else RigParameters()
        physics = self._hidden.physics(parameters)
        deviations = {name: width for name, width in DEVIATIONS.items() if name in self.outputs}
        plant: Plant = _PLANTS[signals](physics)
        sensor_noise = Noise(deviations, number) if noise == "on" else None
        self._rig = SteppedRig(plant, tuple(chosen.outputs), sensor_noise)
        # tick of the clock to which the rig has been advanced; None while time is not real
        self._ticks: int | None = None
        self._stepped = False
        self._commands = dict.fromkeys(self.inputs, 0.0)

    def tell(self) -> str:
        """Describe the hidden effect.

        Returns
        -------
        str
        """
        return str(self._hidden)

    def read(self) -> Mapping[str, float]:
        """Measure, after an advance to the present if time is real.

        Returns
        -------
        Mapping of str to float
        """
        if self._ticks is not None:
            now = _now()
            ticks = min(now - self._ticks, round(_GAP / _TICK))
            self._ticks = now
            if ticks > 0:
                self._rig.advance(ticks * _TICK)
        return self._rig.measured()

    def write(self, values: Mapping[str, float]) -> None:
        """Set the commands from now on.

        Parameters
        ----------
        values : Mapping of str to float
            SI.

        Raises
        ------
        UserError
            If one is missing, unknown or not finite.
        """
        checked = commands(values, self.inputs)
        if self._ticks is not None:
            self.read()  # the commands before apply until now
        elif not self._stepped:
            self._ticks = _now()
        self._rig.command(checked)
        self._commands = dict(checked)

    def read_back(self) -> Mapping[str, float]:
        """Return the commands that the emulated rig has.

        Returns
        -------
        Mapping of str to float
            SI.
        """
        return self._commands

    def advance(self, step: float) -> None:
        """Advance the rig by a step with constant commands.

        Parameters
        ----------
        step : float
            s, at most 60.

        Raises
        ------
        UserError
            If it is out of range.
        """
        self._stepped = True
        self._ticks = None
        self._rig.advance(checked_step(step, _LONGEST))

    def safe(self) -> None:
        """Set zero current, zero force or coil voltage, and the unloaded length."""
        if self._ticks is not None:
            self.read()
        self._rig.release()
        self._commands = dict.fromkeys(self.inputs, 0.0)

    def close(self) -> None:
        """Do nothing: there is no device."""


def _now() -> int:
    return int(time.perf_counter() / _TICK)  # as monotonic, but fine enough on every platform
