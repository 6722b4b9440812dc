"""Drawn records of a plant with hidden truth: one to fit and one that is held out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fmus.kit.arrays import Array
from studies.outside.elements import Element
from studies.outside.plants import PLANTS, Floats, Plant
from studies.outside.stimuli import HELD, NAMES, stimulus
from studies.outside.truths import KINDS, Kind, drawer

_FAINT = 3.0  # noise widths that a truth leaves at least where the parameters are refitted
_TRIES = 30
# Of ten records of a plant: two are clean, two have two truths, of the others half are inside.
_TURNS = (
    "inside", "outside", "clean", "inside", "two", "outside", "inside", "outside", "two", "clean",
)  # fmt: skip
_WIDE = 4.0  # spread of what is held out, in that of what is fitted, at most
_REACHED = 0.7  # of the strength that is aimed at


@dataclass(frozen=True)
class OutsideCase:
    """A record to draw.

    Attributes
    ----------
    seed, number : int
    plant : str
    group : str
        ``clean``, ``inside``, ``outside``, or ``two`` at once.
    """

    seed: int
    number: int
    plant: str
    group: str


@dataclass(frozen=True)
class Hidden:
    """A truth of a certain size.

    Attributes
    ----------
    kind : Kind
    element : Element
    size : float
    """

    kind: Kind
    element: Element
    size: float


@dataclass(frozen=True)
class Run:
    """A simulated record.

    Attributes
    ----------
    time : ndarray, shape (n,)
    inputs : ndarray, shape (n, nu)
        With a controller, as it chose them by noisy outputs.
    exact, measured : ndarray, shape (n, ny)
        Outputs without and with noise.
    stimuli : tuple of str
    held : bool
        Whether inputs are held between samples, or go in straight lines.
    """

    time: Array
    inputs: Array
    exact: Array
    measured: Array
    stimuli: tuple[str, ...]
    held: bool


@dataclass(frozen=True)
class Drawn:
    """Two records of a plant, and what is known only to who judges.

    Attributes
    ----------
    plant : Plant
    parameters : Mapping of str to float
        True values.
    nominal : Mapping of str to float
        As the model declares them.
    hidden : tuple of Hidden
    fitted, held_out : Run
    noise : ndarray, shape (ny,)
        Standard deviations.
    correlation : float
        Of noise from sample to sample.
    strength : float
        Root mean square that the truth leaves on fitted samples after a linear refit of the
        parameters, in standard deviations of the outputs.
    """

    plant: Plant
    parameters: Mapping[str, float]
    nominal: Mapping[str, float]
    hidden: tuple[Hidden, ...]
    fitted: Run
    held_out: Run
    noise: Array
    correlation: float
    strength: float

    @property
    def group(self) -> str:
        """One of ``clean``, ``inside``, ``outside``, ``two``."""
        if len(self.hidden) == 2:
            return "two"
        if not self.hidden:
            return "clean"
        return "inside" if self.hidden[0].kind.inside else "outside"

    @property
    def right(self) -> list[list[tuple[str, str]]]:
        """The pairs of law and signal that are right, of each truth."""
        return [one.kind.right(self.plant) for one in self.hidden]

    @cached_property
    def spread(self) -> Array:
        """Standard deviations of the held-out outputs (ny,)."""
        return np.asarray(self.held_out.measured.std(axis=0))


def cases(records: int, seed: int) -> list[OutsideCase]:
    """Return the cases of a study; plants and groups take turns."""
    return [case_of(seed, number) for number in range(records)]


def case_of(seed: int, number: int) -> OutsideCase:
    """Return one of the cases."""
    group = _TURNS[number // len(PLANTS) % len(_TURNS)]
    return OutsideCase(seed, number, PLANTS[number % len(PLANTS)].name, group)


def draw_outside(case: OutsideCase) -> Drawn:
    """Draw the two records of a case.

    Raises
    ------
    RuntimeError
        If no draw shows its truth; does not happen with the kinds at hand.
    """
    plant = next(plant for plant in PLANTS if plant.name == case.plant)
    for attempt in range(_TRIES):
        rng = np.random.default_rng([case.seed, case.number, attempt])
        try:
            drawn = _draw(plant, case.group, rng)
        except (OverflowError, FloatingPointError):
            continue
        if drawn is not None:
            return drawn
    raise RuntimeError(f"no record of {plant.name} in {_TRIES} tries: {case}")


def _draw(plant: Plant, group: str, rng: np.random.Generator) -> Drawn | None:
    d = drawer(rng)
    parameters = {name: value * d(0.8, 1.25) for name, value in plant.parameters.items()}
    nominal = {name: value * d(0.75, 1.33) for name, value in parameters.items()}
    nominal |= {name: parameters[name] for name in plant.known}
    share, correlation = d(0.003, 0.03), float(rng.choice([0.0, rng.uniform(0.5, 0.95)]))
    held = bool(rng.integers(2))  # by the same hardware in both records
    plans = [_Plan(plant, held, rng), _Plan(plant, held, rng)]
    aim = max(d(0.06, 0.35), _FAINT * share)
    hidden: tuple[Hidden, ...] = ()
    strength = 0.0
    if group != "clean":
        part = aim if group != "two" else aim / math.sqrt(2.0)
        for kind in _kinds(plant, group, rng):
            scaled = _scaled(plant, parameters, kind.make(d), kind, plans[0], part)
            if scaled is None or scaled[1] < max(_FAINT * share, _REACHED * part):
                return None
            hidden = (*hidden, scaled[0])
            strength = math.hypot(strength, scaled[1])
    exact = plans[0].run(plant, parameters, hidden, False).exact
    noise = np.asarray(share * exact.std(axis=0))
    runs = [
        plan.run(plant, parameters, hidden, late, (noise, correlation, rng))
        for plan, late in zip(plans, (False, True), strict=True)
    ]
    return Drawn(plant, parameters, nominal, hidden, runs[0], runs[1], noise, correlation, strength)


def _kinds(plant: Plant, group: str, rng: np.random.Generator) -> list[Kind]:
    """Draw one kind, or two of which no cause of one is right of the other."""
    kinds = KINDS[plant.name]
    if group != "two":
        of_group = [kind for kind in kinds if kind.inside == (group == "inside")]
        return [of_group[int(rng.integers(len(of_group)))]]
    first = kinds[int(rng.integers(len(kinds)))]
    others = [k for k in kinds if not set(k.right(plant)) & set(first.right(plant))]
    return [first, others[int(rng.integers(len(others)))]]


class _Plan:
    """The stimuli of a record: of the inputs, or of the reference of a controller."""

    def __init__(self, plant: Plant, held: bool, rng: np.random.Generator):
        names = [n for n in NAMES if held or n not in HELD]
        control = plant.controller
        ranges = plant.ranges if control is None else ((control.low, control.high),)
        self.names = tuple(str(rng.choice(names)) for _ in ranges)
        self.held = held or control is not None
        columns = [
            stimulus(name, plant.samples, plant.slow / plant.step, levels, rng)
            for name, levels in zip(self.names, ranges, strict=True)
        ]
        self.columns = np.column_stack(columns)

    def run(
        self,
        plant: Plant,
        parameters: Mapping[str, float],
        hidden: Sequence[Hidden],
        late: bool,
        noise: tuple[Array, float, np.random.Generator] | None = None,
    ) -> Run:
        """Simulate, in a closed loop if the plant has a controller."""
        added = np.zeros((plant.samples, len(plant.outputs)))
        if noise is not None:
            added = noise_of(plant.samples, *noise)
        course = self.columns, self.held
        inputs, exact = simulate(plant, parameters, hidden, *course, late=late, noise=added)
        time = np.asarray(plant.step * np.arange(plant.samples), dtype=float)
        measured = np.asarray(exact + added)
        return Run(time, np.asarray(inputs), exact, measured, self.names, self.held)


def noise_of(samples: int, widths: Array, correlation: float, rng: np.random.Generator) -> Array:
    """Return noise (n, ny) of given widths, correlated from sample to sample (AR(1))."""
    white = rng.standard_normal((samples, len(widths)))
    noise = white.copy()
    fresh = math.sqrt(1.0 - correlation**2)
    for k in range(1, samples):
        noise[k] = correlation * noise[k - 1] + fresh * white[k]
    return np.asarray(noise * widths)


def simulate(
    plant: Plant,
    parameters: Mapping[str, float],
    hidden: Sequence[Hidden],
    stimuli: Array,
    held: bool,
    *,
    late: bool = False,
    noise: Array | None = None,
) -> tuple[Array, Array]:
    """Simulate by the method of Runge and Kutta (fourth order); return inputs and outputs.

    Parameters
    ----------
    plant : Plant
    parameters : Mapping of str to float
    hidden : sequence of Hidden
    stimuli : ndarray, shape (n, nu) or (n, 1)
        Inputs; of a plant with a controller its reference, unless `noise` is None.
    held : bool
        Whether inputs are held between samples.
    late : bool
        Whether the change of a plant is past from the beginning.
    noise : ndarray, shape (n, ny), optional
        That a controller sees; None for an open loop.
    """
    laws = Laws(plant, parameters, hidden)
    n, control = len(stimuli), plant.controller if noise is not None else None
    h = plant.step / plant.substeps
    integral = 0.0
    inputs, outputs = np.array(stimuli, dtype=float), np.empty((n, len(plant.outputs)))
    w = laws.start(plant.start, inputs[0].tolist())
    for k in range(n):
        laws.is_late = late or k >= n // 2
        u = inputs[k].tolist()
        if control is not None:
            assert noise is not None
            seen = laws.outputs(w, u)[control.output] + noise[k, control.output]
            error = inputs[k, 0] - seen
            wanted = control.gain * error + integral
            u = [max(-control.limit, min(control.limit, wanted))]
            if u[0] == wanted:  # the integral waits where the input is at its limit
                integral += control.integral * plant.step * error
            inputs[k] = u
        outputs[k] = laws.outputs(w, u)
        if k == n - 1:
            break
        end = u if held or control is not None else inputs[k + 1].tolist()
        for part in range(plant.substeps):
            at = [_between(u, end, (part + c) / plant.substeps) for c in (0.0, 0.5, 1.0)]
            w = _step(laws, w, at, h)
    if not np.isfinite(outputs).all():
        raise FloatingPointError(f"{plant.name} runs away")
    return inputs, outputs


def _between(first: Floats, last: Floats, share: float) -> list[float]:
    return [a + share * (b - a) for a, b in zip(first, last, strict=True)]


def _step(laws: Laws, w: list[float], u: Sequence[Floats], h: float) -> list[float]:
    k1 = laws.rates(w, u[0])
    k2 = laws.rates([x + 0.5 * h * k for x, k in zip(w, k1, strict=True)], u[1])
    k3 = laws.rates([x + 0.5 * h * k for x, k in zip(w, k2, strict=True)], u[1])
    k4 = laws.rates([x + h * k for x, k in zip(w, k3, strict=True)], u[2])
    return [
        x + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        for x, a, b, c, d in zip(w, k1, k2, k3, k4, strict=True)
    ]


class Laws:
    """A plant with what is hidden in it, as functions of states and memories, and of inputs.

    Attributes
    ----------
    is_late : bool
        Whether a change of the plant is past.
    """

    def __init__(self, plant: Plant, parameters: Mapping[str, float], hidden: Sequence[Hidden]):
        self._plant = plant
        self._parameters = parameters
        self._hidden = hidden
        self._signals: dict[str, float] = dict(parameters)
        self._none = dict.fromkeys((law for laws in plant.balances for law in laws), 0.0)
        self.is_late = False

    def start(self, x: Floats, u: Floats) -> list[float]:
        """Return states and memories in equilibrium with the signals at the beginning."""
        self._see(x, u)
        return [*x, *(z for one in self._hidden for z in one.element.start(self._signals))]

    def rates(self, w: Floats, u: Floats) -> list[float]:
        """Return the rates of states and memories."""
        x, added = self._added(w, u)
        rates = list(self._plant.rates(x, u, self._parameters, added))
        at = len(x)
        for one in self._hidden:
            own = one.element.rates(self._signals, w[at:])
            rates += own
            at += len(own)
        return rates

    def outputs(self, w: Floats, u: Floats) -> tuple[float, ...]:
        """Return the outputs."""
        x, added = self._added(w, u)
        return self._plant.outputs_of(x, u, self._parameters, added)

    def _see(self, x: Floats, u: Floats) -> None:
        self._signals.update(zip(self._plant.states, x, strict=True))
        self._signals.update(zip(self._plant.inputs, u, strict=True))
        self._signals["late"] = float(self.is_late)

    def _added(self, w: Floats, u: Floats) -> tuple[Floats, Mapping[str, float]]:
        """Return the states, and what is added to each law."""
        count = len(self._plant.states)
        x = w[:count]
        self._see(x, u)
        if not self._hidden:
            return x, self._none
        added = dict(self._none)
        at = count
        for one in self._hidden:
            memories = len(one.element.start(self._signals))
            value = one.element.value(self._signals, w[at : at + memories])
            added[one.kind.place] += one.size * value
            at += memories
        return x, added


def _scaled(
    plant: Plant,
    parameters: Mapping[str, float],
    element: Element,
    kind: Kind,
    plan: _Plan,
    aim: float,
) -> tuple[Hidden, float] | None:
    """Return a truth of which so much is left after a linear refit, in spreads, and how much is."""
    size = 1.0
    if not math.isfinite(element.most):
        size = 1e-3
    basis = None
    best = None
    for _ in range(6):
        hidden = Hidden(kind, element, size)
        run = plan.run(plant, parameters, (hidden,), False)
        if basis is None or plant.controller is not None:
            basis = _basis(plant, parameters, run)
        left = _left(plant, parameters, run, basis)
        best = hidden, left
        if not left:
            return None
        if abs(left - aim) < 0.1 * aim:
            return best
        wanted = size * float(np.clip(aim / left, 1e-3, 1e3))
        if min(wanted, element.most) == size:
            return best
        size = min(wanted, element.most)
    return best if best is not None and best[1] > _REACHED * aim else None


def _basis(plant: Plant, parameters: Mapping[str, float], run: Run) -> Array:
    """Return an orthonormal basis of what the parameters are able to do to the outputs."""
    columns = []
    for name, value in parameters.items():
        if name in plant.known:
            continue
        sides = [
            simulate(plant, {**parameters, name: value * f}, (), run.inputs, run.held)[1]
            for f in (0.99, 1.01)
        ]
        columns.append((sides[1] - sides[0]) / run.exact.std(axis=0))
    return np.linalg.qr(np.stack([c.ravel() for c in columns], axis=1))[0]


def _left(plant: Plant, parameters: Mapping[str, float], run: Run, basis: Array) -> float:
    """Return the root mean square that a linear refit leaves, in spreads."""
    without = simulate(plant, parameters, (), run.inputs, run.held)[1]
    effect = ((run.exact - without) / run.exact.std(axis=0)).ravel()
    return float(np.sqrt(np.mean((effect - basis @ (basis.T @ effect)) ** 2)))
