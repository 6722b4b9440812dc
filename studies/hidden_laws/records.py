"""Records of plants with a change in one of their laws, otherwise drawn as clean ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from fmus.kit.arrays import Array
from studies.clean import Case, CleanRecord, draw, in_turn, timing_of
from studies.hidden import COARSE, STRENGTHS, base_refit, widths
from studies.hidden_laws.kinds import KINDS, NAMES
from studies.hidden_laws.place import Curve, Lack
from studies.hidden_laws.shapes import Kind
from studies.plants import OWN, PLANTS, simulate


@dataclass(frozen=True)
class LawCase(Case):
    """A record to draw, and the part that one of its laws lacks."""

    hidden: str = ""
    strength: float = 1.0

    def __str__(self) -> str:
        return f"{self.hidden}, {self.strength:g}, {super().__str__()}"

    @property
    def kind(self) -> Kind:
        """The hidden part."""
        return KINDS[self.hidden]


def lack_of(case: LawCase, strength: float | None = None) -> Lack:
    """Return the term hidden in a case, sized; of another strength if given, 0 for none."""
    _, duration, _ = timing_of(PLANTS[case.plant], case.timing)
    rng = np.random.default_rng([case.seed, *case.hidden.encode()])
    return case.kind.drawn(rng, case.strength if strength is None else strength, duration)


def draw_lack(case: LawCase, strength: float | None = None) -> CleanRecord:
    """Draw one record; of another strength if wanted, 0 for none."""
    return draw(case, plant=PLANTS[case.plant].with_hidden(lack_of(case, strength).change))


def cases(count: int, seed: int, plants: Sequence[str] = NAMES) -> list[LawCase]:
    """Draw cases: plants, kinds of noise, kinds of lack and strengths in turn."""
    choices: dict[str, dict[str, list[tuple[str, ...]]]] = {name: {} for name in NAMES}
    for name, kind in KINDS.items():
        choices[kind.plant].setdefault(kind.kind, []).append((name,))
    groups = {plant: [*choices[plant].values()] for plant in plants}
    drawn = in_turn(count, seed, plants, np.random.default_rng([seed, 30]), groups)
    return [
        LawCase(**asdict(case), hidden=hidden, strength=STRENGTHS[turn % len(STRENGTHS)])
        for case, (hidden,), turn in drawn
    ]


@dataclass(frozen=True)
class Base:
    """Results of the clean plant for a record: remaining noise widths, outputs, states (n,)."""

    left: float
    outputs: dict[str, Array]
    states: dict[str, Array]


def base_of(drawn: CleanRecord) -> Base:
    """Refit the clean plant by plain least squares."""
    base, values = base_refit(drawn)
    outputs, states = _simulated(base, values, COARSE)
    return Base(max(widths(drawn, outputs).values()), outputs, states)


def series(drawn: CleanRecord) -> dict[str, Array]:
    """Return true signals of a plant at the samples, (n,) each, SI.

    Of a law that depends on itself this is the value without what is hidden.
    """
    _, states = _simulated(drawn, drawn.truth, drawn.plant.finest)
    rows = np.array([*states.values(), *drawn.inputs.values()]).T.tolist()
    count = len(states)
    several = [drawn.plant.evaluate(row[:count], row[count:], drawn.truth) for row in rows]
    public = [name for name in several[0] if not name.startswith("_")]
    found = {name: np.array([k[name] for k in several]) for name in public}
    without = found.pop(OWN, None)
    return found | ({} if without is None else dict.fromkeys(drawn.plant.places, without))


def curve_of(drawn: CleanRecord, lack: Lack) -> Curve | None:
    """Return the hidden term as a curve of what a search counts from the first sample on."""
    if lack.curve is None or not lack.change.rest:
        return lack.curve
    before = drawn.truth[f"{lack.change.place}_memory_0_start"]
    curve = lack.curve
    return lambda x: curve(before + x)


def _simulated(
    drawn: CleanRecord, values: dict[str, float], finest: float
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return outputs and states of the plant of a record."""
    plant = drawn.plant
    own = dict(plant.nominal) | {n: v for n, v in values.items() if n in plant.nominal}
    start = np.array([values[f"{n}_start"] for n in plant.states])
    u = np.stack([drawn.inputs[n] for n in plant.inputs])
    linear = np.array([n in set(drawn.smooth) - set(plant.sampled) for n in plant.inputs])
    y, x = simulate(plant, own, drawn.step, u, start, linear, finest=finest)
    y = plant.recorded(y, drawn.step)
    return dict(zip(plant.outputs, y, strict=True)), dict(
        zip(plant.states, np.asarray(x), strict=True)
    )
