"""Benches drawn at random: a specimen, its inputs, and the recorded part of a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from demonstrations.emulator import EmulatedRig, Physics, RigParameters, refit_residuals
from orchestration.experiment.waveforms import multilevel

Array = NDArray[np.float64]
NOISE = {"voltage": 4e-3, "displacement": 3e-6}  # V, m
_RUN_IN = (100.0, 300.0)  # s, before a record that does not start at rest


@dataclass(frozen=True)
class Bench:
    """An actuator and its inputs; the record begins after the first `lead` samples."""

    parameters: RigParameters
    time: Array
    current: Array
    force: Array
    lead: int
    outputs: tuple[str, ...]

    @classmethod
    def drawn(
        cls,
        random: np.random.Generator,
        duration: float,
        rate: float,
        outputs: tuple[str, ...],
        *,
        at_rest: bool,
        changed: Mapping[str, float],
        spread: float,
    ) -> Bench:
        """Draw a bench with multilevel current within 1.3 A and force between a bias and 3 N.

        Both are at rest at first. `changed` has factors of nominal values by parameter; all other
        factors differ from 1 by at most `spread`.
        """
        nominal = asdict(RigParameters())
        factors = {name: random.uniform(1 - spread, 1 + spread) for name in nominal} | dict(changed)
        parameters = RigParameters(**{name: nominal[name] * factors[name] for name in nominal})
        lead = 0 if at_rest else round(random.uniform(*_RUN_IN) * rate)
        time = np.arange(-lead, round(duration * rate)) / rate
        peak = random.uniform(0.8, 1.3)
        dwell = random.uniform(1.0, 3.0)
        levels = peak * np.array([-1.0, *random.uniform(-0.9, 0.9, 4), 1.0])
        current = multilevel(
            time,
            levels.tolist(),
            (dwell, dwell * random.uniform(3.0, 6.0)),
            int(random.integers(2**31)),
        )
        bias = random.uniform(0.3, 0.5)
        top = random.uniform(2.5, 3.0)
        loads = [bias, *random.uniform(bias, top, 5), top]
        hold = random.uniform(6.0, 15.0)
        force = multilevel(
            time, loads, (hold, hold * random.uniform(2.0, 4.0)), int(random.integers(2**31))
        )
        quiet = time < time[0] + random.uniform(2.0, 5.0)
        return cls(
            parameters,
            time,
            np.where(quiet, 0.0, current),
            np.where(quiet, bias, force),
            lead,
            outputs,
        )

    def noise_free(self, physics: Callable[[RigParameters], Physics]) -> dict[str, Array]:
        """Return the outputs (n,) of the record without noise, by name."""
        rig = EmulatedRig(self.parameters, hidden=physics)
        rig.run(self.time, self.current, self.force)
        return {output: rig.truth[output][self.lead :] for output in self.outputs}

    def widths(self, outputs: Mapping[str, Array]) -> dict[str, float]:
        """Return the noise widths of the refitted base in noise-free outputs (n,), by output."""
        current = self.current[self.lead :]
        force = self.force[self.lead :]
        residuals = refit_residuals(
            self.time[1] - self.time[0], current, force, outputs, NOISE, self.parameters
        )
        return {
            output: float(np.sqrt(np.mean(r**2)) / NOISE[output]) for output, r in residuals.items()
        }
