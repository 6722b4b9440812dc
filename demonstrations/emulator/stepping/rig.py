"""Emulated rig that is advanced step by step with constant inputs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from demonstrations.emulator.physics import Array
from demonstrations.emulator.stepping.bench import BenchPlant
from demonstrations.emulator.stepping.memory import Instant, Past, Reaching, Remembering
from demonstrations.emulator.stepping.noise import Noise
from demonstrations.emulator.stepping.plants import Plant

_SLIVER = 1e-12  # s, rest of a step by rounding


class SteppedRig:
    """A plant with sensors and a clock, at rest at first.

    It is deterministic: equal commands and steps give equal bits.

    Parameters
    ----------
    plant : Plant
    outputs : sequence of str
        Measured outputs.
    noise : Noise, optional
        Noise of the sensors; by default none.

    Attributes
    ----------
    time : float
        Time since the start, s.
    """

    def __init__(self, plant: Plant, outputs: tuple[str, ...], noise: Noise | None = None):
        self.plant = plant
        self.outputs = outputs
        self._noise = noise
        self.time = 0.0
        self._state: Array = np.zeros(plant.order)
        self._commands: Array = np.zeros(len(plant.inputs))
        self._held: Array = np.zeros(2)
        self._remembering = plant.physics if isinstance(plant.physics, Remembering) else None
        self._past = Past(plant.physics, plant.advance, self._actuator)

    def command(self, values: Mapping[str, float]) -> None:
        """Set every input (SI) from now on.

        Raises
        ------
        ValueError
            If one is missing or not finite; then no input is changed.
        """
        commands = [values.get(name, np.nan) for name in self.plant.inputs]
        for name, value in zip(self.plant.inputs, commands, strict=True):
            if not np.isfinite(value):
                raise ValueError(f"{name} = {values.get(name, 'missing')}: must be a finite number")
        self._commands = np.array(commands, dtype=float)
        if isinstance(self.plant, BenchPlant):
            self.plant.released = False
            self._held = np.array([values["current"], self.plant.voltage])
        else:
            self._held = self._commands

    def release(self) -> None:
        """Set zero current, zero force or coil voltage, and the unloaded length."""
        self._commands = np.zeros_like(self._commands)
        self._held = np.zeros(2)
        if isinstance(self.plant, BenchPlant):
            self.plant.release()

    def advance(self, step: float) -> None:
        """Advance the plant by a step with constant commands.

        Parameters
        ----------
        step : float
            s, positive.
        """
        done = 0.0
        while step - done > _SLIVER:
            now = self.time + done
            held = self.plant.hold(self._state, self._commands, now)
            piece = min(step - done, self.plant.longest(now))
            self._pass(now, held, piece)
            done += piece
        self.time += step
        if self._noise:
            self._noise.sample()

    def _pass(self, now: float, held: Array, piece: float) -> None:
        before = self._state
        self._held = held
        if self._past.reach:
            self._past.add(now, before, held)
        self._state = self.plant.advance(before, held, piece)
        if self._remembering:
            self._remembering.passed(
                piece, self._instant(now, before), self._instant(now + piece, self._state)
            )

    def _actuator(self, state: Array, held: Array) -> tuple[Array, Array]:
        return state[: self.plant.physics.order], self.plant.terminal(state, held)

    def _instant(self, time: float, state: Array) -> Instant:
        own, inputs = self._actuator(state, self._held)
        return Instant(
            self.plant.physics, np.array([time]), inputs[:, np.newaxis], own[:, np.newaxis]
        )

    def true(self) -> dict[str, float]:
        """Return the present outputs without noise, SI."""
        physics = self.plant.physics
        now = self._instant(self.time, self._state)
        state = now.state[:, 0]
        force = now.inputs[1, 0]
        run = (
            Reaching(now.physics, now.time, now.inputs, now.state, self._past)
            if self._past.reach
            else now
        )
        sensed = {name: float(values[0]) for name, values in physics.sensed(run, now.time).items()}
        everything = {
            **sensed,
            "electrochemical_displacement": float(
                physics.electrochemical_length(physics.active_charge(state))
            ),
            "mechanical_displacement": float(physics.mechanical_length(state, force)),
            "charge": float(state[0]),
            **self.plant.shown(self._state, self._held),
        }
        return {name: everything[name] for name in self.outputs}

    def measured(self) -> dict[str, float]:
        """Return the present outputs with noise, SI, equal for repeated calls."""
        noise = self._noise.values if self._noise else {}
        return {name: value + noise.get(name, 0.0) for name, value in self.true().items()}
