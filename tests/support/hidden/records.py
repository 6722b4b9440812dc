"""Records in which something is hidden: drawn as clean ones are, of plants that have a change at one place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tests.support.clean.judge import least_squares_fit
from tests.support.clean.plants import PLANTS
from tests.support.clean.records import KINDS, Case, CleanRecord, conditions, draw, timing_of
from tests.support.clean.simulation import FINEST
from tests.support.hidden.plants import NAMES, altered
from tests.support.hidden.variations import OUTSIDE, STRENGTHS, VARIATIONS, Variation

Array = NDArray[np.float64]
COARSE = 0.05  # s, steps of the judge's simulations of what is not linear
STARTS = 2  # of the refit of the base: where the truth is, and beside it


@dataclass(frozen=True)
class HiddenCase(Case):
    """What to draw, and what to hide in it."""

    hidden: str = ""
    strength: float = 1.0

    def __str__(self) -> str:
        return f"{self.hidden}, {self.strength:g}, {super().__str__()}"

    @property
    def variation(self) -> Variation:
        """What is hidden."""
        return VARIATIONS[self.hidden]


def draw_hidden(case: HiddenCase, strength: float | None = None) -> CleanRecord:
    """Draw one record; of another strength if wanted, 0 for none."""
    plain = Case(**{n: getattr(case, n) for n in Case.__dataclass_fields__})
    _, duration, _ = timing_of(PLANTS[case.plant], case.timing)
    rng = np.random.default_rng([case.seed, *case.hidden.encode()])
    change = case.variation.drawn(rng, case.strength if strength is None else strength, duration)
    return draw(plain, plant=altered(case.plant, change))


def cases(count: int, seed: int) -> list[HiddenCase]:
    """Draw cases: plants, kinds of noise and strengths in turn, families of a plant at random, the rest as clean ones.

    One in six is outside every family.
    """
    rng = np.random.default_rng([seed, 13])
    families: dict[str, list[str]] = {}
    drawn = []
    for k in range(count):
        plant = PLANTS[NAMES[k % len(NAMES)]]
        turn = k // len(NAMES)
        left = families.setdefault(plant.name, [])
        if not left:
            every = list(dict.fromkeys(v.family for v in VARIATIONS.values() if v.plant == plant.name))
            left += [every[i] for i in rng.permutation(len(every))]
        family = left.pop()
        shapes = [n for n, v in VARIATIONS.items() if (v.plant, v.family) == (plant.name, family)]
        hidden = shapes[rng.integers(len(shapes))]
        noise = KINDS[(k + turn) % len(KINDS)]
        if noise == "jitter" and plant.rate > 200.0:
            noise = KINDS[0]
        case = conditions(plant, noise, 100_000 * seed + k, rng)
        drawn.append(HiddenCase(**asdict(case), hidden=hidden, strength=STRENGTHS[turn % len(STRENGTHS)]))
    return drawn


def base_refit(drawn: CleanRecord) -> tuple[CleanRecord, dict[str, float]]:
    """The record as one of the clean plant, and what plain least squares makes of its parameters."""
    plant = PLANTS[drawn.case.plant]
    base = replace(drawn, plant=plant)
    own = {n: drawn.truth[n] for n in plant.nominal} | {f"{n}_start": drawn.truth[f"{n}_start"] for n in plant.states}
    sizes = {f"{n}_start": max(abs(own[f"{n}_start"]), 1e-6) for n in plant.states}
    _, values = least_squares_fit(
        lambda tried: base.simulated(tried, COARSE if plant.matrices(own) is None else FINEST),
        drawn.outputs, own, drawn.regular, starts=STARTS, sizes=sizes,
    )  # fmt: skip
    return base, values


def widths(drawn: CleanRecord, simulated: Mapping[str, Array]) -> dict[str, float]:
    """Noise widths that are left: rms of what a model misses of the outputs without noise, over that of the noise."""
    return {
        o: float(np.sqrt(np.mean((y - simulated[o]) ** 2))) / max(drawn.deviation[o], 1e-12 * float(np.ptp(y)) + 1e-300)
        for o, y in drawn.clean.items()
    }


def left(drawn: CleanRecord) -> float:
    """Noise widths that the hidden change leaves in the worst of the outputs after a refit of the base."""
    base, values = base_refit(drawn)
    return max(widths(drawn, base.simulated(values, COARSE)).values())


def effective_samples(drawn: CleanRecord) -> dict[str, float]:
    """Samples of white noise that tell as much as those of each output, by the colour of its noise."""
    found = {}
    for output, y in drawn.outputs.items():
        noise = y - drawn.clean[output]
        colour = max(0.0, float(np.corrcoef(noise[:-1], noise[1:])[0, 1])) if np.std(noise) > 0.0 else 0.0
        found[output] = y.size * (1.0 - colour) / (1.0 + colour)
    return found


__all__ = ["OUTSIDE", "HiddenCase", "base_refit", "cases", "draw_hidden", "effective_samples", "left", "widths"]
