"""Records of plants with one or two hidden changes, otherwise drawn as clean ones."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import combinations

import numpy as np

from fmus.kit.arrays import Array
from studies.clean import Case, CleanRecord, draw, in_turn, least_squares_fit, timing_of
from studies.hidden.variations import OUTSIDE, STRENGTHS, USUAL, VARIATIONS, Variation
from studies.plants import PLANTS, Plant

COARSE = 0.05  # s, steps of the judge's simulations of what is not linear
STARTS = 2  # of the refit of the base: where the truth is, and beside it
SLIGHT = 1e-4  # of a parameter, by which what it can do is found to first order
Choices = dict[tuple[str, ...], list[tuple[str, ...]]]  # what may be hidden, by families


@dataclass(frozen=True)
class HiddenCase(Case):
    """A record to draw, and the variations to hide in it."""

    hidden: str = ""
    strength: float = 1.0
    second: str | None = None  # hidden at the same time

    def __str__(self) -> str:
        names = " + ".join(one.hidden for one in self.alone())
        return f"{names}, {self.strength:g}, {super().__str__()}"

    @property
    def variation(self) -> Variation:
        """The hidden variation, the first of two."""
        return VARIATIONS[self.hidden]

    def alone(self) -> list[HiddenCase]:
        """Return the same conditions with each of the hidden changes by itself."""
        names = [self.hidden] if self.second is None else [self.hidden, self.second]
        return [replace(self, hidden=name, second=None) for name in names]


def draw_hidden(case: HiddenCase, strength: float | None = None) -> CleanRecord:
    """Draw one record; of another strength if wanted, 0 for none."""
    _, duration, _ = timing_of(PLANTS[case.plant], case.timing)
    changes = [
        one.variation.drawn(
            np.random.default_rng([one.seed, *one.hidden.encode()]),
            one.strength if strength is None else strength,
            duration,
        )
        for one in case.alone()
    ]
    return draw(case, plant=PLANTS[case.plant].with_hidden(*changes))


def cases(count: int, seed: int, plants: Sequence[str] = USUAL) -> list[HiddenCase]:
    """Draw cases of one hidden effect; one in six is outside every family."""
    return list(_cases(count, seed, plants, 13, _single))


def cases_of_two(count: int, seed: int, plants: Sequence[str] = USUAL) -> list[HiddenCase]:
    """Draw cases of two effects at once, of one strength."""
    return list(_cases(count, seed, plants, 14, _double))


def _single(plant: str) -> Choices:
    choices: Choices = {}
    for name, variation in VARIATIONS.items():
        if variation.plant == plant:
            choices.setdefault((variation.family,), []).append((name,))
    return choices


def _double(plant: str) -> Choices:
    """Draw two changes that are two causes: of other families, places and laws."""
    inside = [
        (name, v) for name, v in VARIATIONS.items() if v.plant == plant and v.family != OUTSIDE
    ]
    choices: Choices = {}
    for (first, a), (second, b) in combinations(inside, 2):
        if a.family != b.family and a.place != b.place and not _laws(a) & _laws(b):
            choices.setdefault(tuple(sorted((a.family, b.family))), []).append((first, second))
    return choices


def _laws(variation: Variation) -> set[str]:
    """Return the laws in right names, whatever they are a function of."""
    return {re.split(" over | remembering ", name)[0] for name in variation.right}


def _cases(
    count: int, seed: int, plants: Sequence[str], stream: int, known: Callable[[str], Choices]
) -> Iterator[HiddenCase]:
    rng = np.random.default_rng([seed, stream])
    choices = {name: [*known(name).values()] for name in plants}
    for case, names, turn in in_turn(count, seed, plants, rng, choices):
        hidden = dict(zip(("hidden", "second"), names, strict=False))
        yield HiddenCase(**asdict(case), **hidden, strength=STRENGTHS[turn % len(STRENGTHS)])


def base_refit(drawn: CleanRecord) -> tuple[CleanRecord, dict[str, float]]:
    """Return the record as one of the clean plant, and its parameters by plain least squares."""
    plant = PLANTS[drawn.case.plant]
    base = replace(drawn, plant=plant)
    own = {n: drawn.truth[n] for n in plant.nominal} | {
        f"{n}_start": drawn.truth[f"{n}_start"] for n in plant.states
    }
    sizes = {f"{n}_start": max(abs(own[f"{n}_start"]), 1e-6) for n in plant.states}
    _, values = least_squares_fit(
        lambda tried: base.simulated(tried, max(COARSE, plant.coarsest)),
        drawn.outputs,
        own,
        used=drawn.regular,
        starts=STARTS,
        sizes=sizes,
    )
    return base, values


def widths(drawn: CleanRecord, simulated: Mapping[str, Array]) -> dict[str, float]:
    """Return the model's rms error of every noise-free output over the rms of its noise."""
    noise = _noise(drawn)
    return {
        o: float(np.sqrt(np.mean((y - simulated[o]) ** 2))) / noise[o]
        for o, y in drawn.clean.items()
    }


def _noise(drawn: CleanRecord) -> dict[str, float]:
    return {
        o: max(drawn.deviation[o], 1e-12 * float(np.ptp(y)) + 1e-300)
        for o, y in drawn.clean.items()
    }


def left(drawn: CleanRecord) -> float:
    """Return the noise widths a hidden change leaves in the worst output of a refitted base."""
    base, values = base_refit(drawn)
    return max(widths(drawn, base.simulated(values, max(COARSE, base.plant.coarsest))).values())


def left_beside(drawn: CleanRecord) -> list[float]:
    """Return the noise widths each hidden change leaves in the worst output, the others known.

    What the base's parameters and starting states can do about it is taken away to first order: a
    refit of a plant in which something is hidden takes minutes.
    """
    hidden = drawn.plant.changes
    both = replace(drawn, clean=drawn.simulated(drawn.truth, drawn.plant.finest))
    others = [[change for place, (change, _) in hidden.items() if place != one] for one in hidden]
    return [
        max(widths(both, _refitted(both, PLANTS[drawn.plant.name].with_hidden(*known))).values())
        for known in others
    ]


def _refitted(drawn: CleanRecord, plant: Plant) -> dict[str, Array]:
    """Return outputs of another plant after one step of refitting from the true parameters.

    The step brings the base's parameters as near as they get.
    """
    other = replace(drawn, plant=plant)
    noise = _noise(drawn)

    def simulated(name: str = "", by: float = 0.0) -> Array:
        values = drawn.truth | ({name: drawn.truth[name] + by} if name else {})
        y = other.simulated(values, drawn.plant.finest)
        return np.array([y[o] / noise[o] for o in noise])

    names = [*plant.nominal, *(f"{n}_start" for n in PLANTS[plant.name].states)]
    steps = {n: SLIGHT * max(abs(drawn.truth[n]), SLIGHT * (n not in plant.nominal)) for n in names}
    at = simulated()
    slopes = np.column_stack([((simulated(n, by) - at) / by).ravel() for n, by in steps.items()])
    scaled = slopes / np.maximum(np.linalg.norm(slopes, axis=0), 1e-300)
    wanted = (np.array([y / noise[o] for o, y in drawn.clean.items()]) - at).ravel()
    near = at + (scaled @ np.linalg.lstsq(scaled, wanted, rcond=None)[0]).reshape(at.shape)
    return {o: noise[o] * row for o, row in zip(noise, near, strict=True)}


__all__ = [
    "OUTSIDE",
    "HiddenCase",
    "base_refit",
    "cases",
    "cases_of_two",
    "draw_hidden",
    "left",
    "left_beside",
    "widths",
]
