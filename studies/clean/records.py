"""Clean records: nothing is hidden in them, so that the model is right once its parameters are."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fmus.kit.arrays import Array, Mask
from studies.clean.disturbances import INPUT_NOISE, JITTER, ON_OUTPUTS, jittered
from studies.clean.stimuli import SMOOTH, STIMULI, Shape
from studies.plants import DRAWN, FINEST, PLANTS, Loop, Plant, closed_loop, simulate

Choices = Mapping[str, list[list[tuple[str, ...]]]]  # what may be hidden in plants, by groups
CLOSED = "closed loop"
RELEASED = "released"  # nothing drives a free decay
KINDS = tuple(ON_OUTPUTS)
BETWEEN = 10  # points between samples where an input is smooth
LEVELS = 1e-3, 2e-2  # of the spread of an output: deviations of noise that are drawn
RUN_IN = 4.0  # periods before the record where it does not start at rest


@dataclass(frozen=True)
class Case:
    """A record to draw: plant, stimulus, noise, seed and timing."""

    plant: str
    stimulus: str
    noise: str
    seed: int
    timing: str = "usual"
    smooth: bool = False
    at_rest: bool = True

    def __str__(self) -> str:
        """Return the case as a line of text."""
        marks = (
            [self.timing] * (self.timing != "usual")
            + ["smooth"] * self.smooth
            + ["moving"] * (not self.at_rest)
        )
        return ", ".join([self.plant, self.stimulus, self.noise, *marks, str(self.seed)])


@dataclass(frozen=True)
class CleanRecord:
    """Signals as measured, SI, and what they come from.

    `time` is what the file says, `step` what passed between samples; `deviation` is that of the
    noise by output, `regular` where no outlier was drawn.
    """

    case: Case
    plant: Plant
    time: Array
    step: float
    inputs: dict[str, Array]
    outputs: dict[str, Array]
    truth: dict[str, float]
    deviation: dict[str, float]
    regular: dict[str, Mask]
    clean: dict[str, Array] = field(repr=False)

    @property
    def smooth(self) -> Collection[str]:
        """Inputs that are not held between samples."""
        return [*self.plant.inputs] if self.case.smooth else self.plant.continuous

    def write(self, path: Path) -> Path:
        """Write a file as a data logger does, in its units."""
        own = {n: r.unit for n, r in self.plant.inputs.items()} | dict(self.plant.outputs)
        units = {n: (unit, 1.0) for n, unit in own.items()} | dict(self.plant.written)
        units["time"] = self.plant.clock
        columns = {"time": self.time, **self.inputs, **self.outputs}
        header = ",".join(f"{n} [{units[n][0]}]" for n in columns)
        rows = [values / units[n][1] for n, values in columns.items()]
        np.savetxt(path, np.column_stack(rows), "%.12g", ",", header=header, comments="")
        return path

    def simulated(
        self,
        values: Mapping[str, float],
        finest: float | None = None,
        smooth: Collection[str] | None = None,
    ) -> dict[str, Array]:
        """Return the plant's outputs with other parameters and starts (`<state>_start`).

        `finest` is the longest step of what is not linear, s; by default what the plant can do with
        where nothing is hidden. `smooth` names inputs that are taken to go linearly; as they were
        drawn unless given.
        """
        own = dict(self.plant.nominal) | {
            n: v for n, v in values.items() if n in self.plant.nominal
        }
        rest = zip(self.plant.states, self.plant.rest(), strict=True)
        start = np.array([values.get(f"{n}_start", at_rest) for n, at_rest in rest])
        u = np.array([self.inputs[n] for n in self.plant.inputs]).reshape(-1, self.time.size)
        chosen = set(self.smooth if smooth is None else smooth) - set(self.plant.sampled)
        linear = np.array([n in chosen for n in self.plant.inputs])
        longest = finest or max(FINEST, self.plant.coarsest)
        y, _ = simulate(self.plant, own, self.step, u, start, linear, finest=longest)
        return dict(zip(self.plant.outputs, self.plant.recorded(y, self.step), strict=True))


def draw(
    case: Case, specimen: Mapping[str, float] | None = None, plant: Plant | None = None
) -> CleanRecord:
    """Draw one record; the same one for the same case.

    Its specimen is drawn too unless its parameters are given.

    Another plant than the one that the case names may be given, which has the same inputs, outputs
    and parameters.
    """
    rng = np.random.default_rng([case.seed, *case.plant.encode()])
    if plant is None:
        plant = PLANTS[case.plant]
    p = plant.specimen(rng) | dict(specimen or {})
    u, y, x, noise = _run(plant, p, case, rng)
    if case.noise == "on input":
        u = u + INPUT_NOISE * np.std(u, axis=1, keepdims=True) * rng.standard_normal(u.shape)
    step = 1.0 / timing_of(plant, case.timing)[0]
    time = np.arange(u.shape[1]) * step
    typical = np.median(np.abs(noise), axis=1) / 0.6745
    regular = np.ones(noise.shape, dtype=bool)
    if case.noise == "outliers":
        regular = np.abs(noise) < 8.0 * typical[:, None]
    elif case.noise == "jitter":
        time = jittered(time, rng)
    return CleanRecord(
        case,
        plant,
        time,
        step,
        dict(zip(plant.inputs, u, strict=True)),
        dict(zip(plant.outputs, y + noise, strict=True)),
        p | {f"{n}_start": float(v) for n, v in zip(plant.states, x[:, 0], strict=True)},
        dict(zip(plant.outputs, typical.tolist(), strict=True)),
        dict(zip(plant.outputs, regular, strict=True)),
        dict(zip(plant.outputs, y, strict=True)),
    )


def _run(
    plant: Plant, p: Mapping[str, float], case: Case, rng: np.random.Generator
) -> tuple[Array, Array, Array, Array]:
    """Return inputs, recorded outputs without noise, states and noise."""
    rate, duration, period = timing_of(plant, case.timing)
    step = 1.0 / rate
    lead = 0 if case.at_rest else int(np.ceil(RUN_IN * period * rate))
    samples = round(duration * rate) + lead
    shape = _shape(case, period, (samples + 1) * step, rng)
    between = BETWEEN if case.smooth else 1
    fine = np.arange(between * (samples - 1) + 1) * (step / between)
    driven = _driven(plant, case, shape, fine, duration, rng)
    level = float(np.exp(rng.uniform(*np.log(LEVELS))))
    if case.smooth:
        u = driven[:, ::between]
        y, x = (
            part[:, ::between]
            for part in simulate(
                plant, p, step / between, driven, plant.start(rng), True, finest=plant.finest
            )
        )
        noise = _noise(case.noise, y, level, rng)
    else:
        u, y, x, noise = _sampled(
            plant,
            p,
            case,
            step=step,
            u=driven,
            start=plant.start(rng),
            reference=shape(fine),
            level=level,
            rng=rng,
        )
    return u[:, lead:], plant.recorded(y, step)[:, lead:], x[:, lead:], noise[:, lead:]


def _shape(case: Case, period: float, duration: float, rng: np.random.Generator) -> Shape:
    """Draw the shape of the stimulus; under feedback it is that of the reference."""
    if case.stimulus == RELEASED:
        return np.zeros_like
    stimulus = "square" if case.stimulus == CLOSED else case.stimulus
    return STIMULI[stimulus](period, duration, rng)


def cases(count: int, seed: int, plants: Sequence[str] = DRAWN) -> list[Case]:
    """Draw cases: plants and kinds of noise in turn, the rest at random."""
    rng = np.random.default_rng(seed)
    drawn = []
    for k in range(count):
        plant = PLANTS[plants[k % len(plants)]]
        noise = KINDS[(k + k // len(plants)) % len(KINDS)]
        if noise == "jitter" and plant.rate > 1.0 / JITTER:
            noise = KINDS[0]  # samples would change their order
        drawn.append(conditions(plant, noise, 100_000 * seed + k, rng))
    return drawn


def conditions(plant: Plant, noise: str, seed: int, rng: np.random.Generator) -> Case:
    """Draw how a plant is driven and sampled."""
    known = [RELEASED] if plant.released else [*STIMULI, *([CLOSED] if plant.loops else [])]
    stimulus = known[rng.integers(len(known))]
    coupled = any(r.amplitude == 0.0 for r in plant.inputs.values())
    smooth = bool(stimulus in SMOOTH and not coupled and rng.random() < 0.3)
    timing = (
        plant.timings[0] if rng.random() < 0.6 else plant.timings[rng.integers(len(plant.timings))]
    )
    at_rest = bool(rng.random() < 0.5) or plant.begins_at_rest or bool(plant.released)
    return Case(plant.name, stimulus, noise, seed, timing, smooth, at_rest)


def in_turn(
    count: int, seed: int, plants: Sequence[str], rng: np.random.Generator, choices: Choices
) -> Iterator[tuple[Case, tuple[str, ...], int]]:
    """Yield cases, what is hidden in each, and its turn.

    Plants and kinds of noise come in turn, and what may be hidden in a plant as well, in an order
    that is drawn; all else as for clean records.

    Parameters
    ----------
    count, seed : int
    plants : sequence of str
    rng : numpy.random.Generator
    choices : mapping of str to list of list of tuple of str
        By plant: groups of what may be hidden, of which a case has one of one group.
    """
    waiting: dict[str, list[list[tuple[str, ...]]]] = {name: [] for name in plants}
    for k in range(count):
        plant = PLANTS[plants[k % len(plants)]]
        turn = k // len(plants)
        left = waiting[plant.name]
        if not left:
            every = choices[plant.name]
            left += [every[i] for i in rng.permutation(len(every))]
        group = left.pop()
        hidden = group[rng.integers(len(group))]
        noise = KINDS[(k + turn) % len(KINDS)]
        if noise == "jitter" and plant.rate > 1.0 / JITTER:
            noise = KINDS[0]  # samples would change their order
        yield conditions(plant, noise, 100_000 * seed + k, rng), hidden, turn


def timing_of(plant: Plant, timing: str) -> tuple[float, float, float]:
    """Return rate (Hz), duration and period of the stimulus (s)."""
    if timing == "one minute":
        return 50.0, 60.0, max(min(plant.period, 60.0 / 16.0), 0.1)
    if timing == "1 Hz":
        return 1.0, 600.0, max(plant.period, 4.0)
    return plant.rate, plant.duration * (3.0 if timing == "long" else 1.0), plant.period


def _driven(
    plant: Plant, case: Case, shape: Shape, time: Array, duration: float, rng: np.random.Generator
) -> Array:
    """Return the inputs: the first is the stimulus, the others are at a constant level.

    Where nothing is smooth, the others move in slow steps.
    """
    still = case.smooth or rng.random() < 0.5
    rows = []
    for k, range_ in enumerate(plant.inputs.values()):
        own = shape(time) if k == 0 else np.zeros_like(time)
        if k and not still:
            levels = rng.uniform(-1.0, 1.0, int(time[-1] / (duration / 9.0)) + 2)
            own = levels[np.floor(time / (duration / 9.0)).astype(int)]
        rows.append(range_.centre + range_.amplitude * own)
    return np.array(rows).reshape(-1, time.size)


def _noise(kind: str, y: Array, level: float, rng: np.random.Generator) -> Array:
    """Return the measurement noise of every output."""
    return np.array([ON_OUTPUTS[kind](row, level * float(np.std(row)), rng) - row for row in y])


def _sampled(
    plant: Plant,
    p: Mapping[str, float],
    case: Case,
    *,
    step: float,
    u: Array,
    start: Array,
    reference: Array,
    level: float,
    rng: np.random.Generator,
) -> tuple[Array, Array, Array, Array]:
    """Return held inputs, clean outputs, states and noise.

    A controller acts on outputs as they are measured.
    """
    loop = (
        list(plant.loops.values())[rng.integers(len(plant.loops))]
        if case.stimulus == CLOSED
        else None
    )

    def run(noise: Array) -> tuple[Array, Array, Array]:
        act = None if loop is None else _Controller(plant, loop, reference, step)

        def feedback(k: int, now: Array, measured: Array, x: Array) -> Array:
            driven = now if act is None else act(k, now, measured)
            more = plant.reaction(p, driven, x)
            return driven if more is None else more

        return closed_loop(plant, p, step, u, start, feedback=feedback, noise=noise)

    fed, y, x = run(np.zeros((len(plant.outputs), u.shape[1])))
    noise = _noise(case.noise, y, level, rng)
    if loop is None:
        return fed, y, x, noise
    fed, y, x = run(noise)
    return fed, y, x, _noise(case.noise, y, level, rng) if case.noise == "12 bit" else noise


class _Controller:
    """A loop about where its output is at first."""

    def __init__(self, plant: Plant, loop: Loop, reference: Array, step: float):
        self._input = list(plant.inputs).index(loop.input)
        self._output = list(plant.outputs).index(loop.output)
        self._loop = loop
        self._reference = reference
        self._step = step
        range_ = plant.inputs[loop.input]
        self._least = range_.centre - 1.5 * range_.amplitude
        self._most = range_.centre + 1.5 * range_.amplitude
        self._held = range_.centre
        self._error = 0.0
        self._first = 0.0

    def __call__(self, k: int, u: Array, measured: Array) -> Array:
        """Return the inputs from this sample on, given what was measured one sample before."""
        if k > 0:
            if k == 1:
                self._first = measured[self._output]
            error = self._first + self._loop.amplitude * self._reference[k] - measured[self._output]
            change = (
                self._loop.proportional * (error - self._error)
                + self._loop.integral * self._step * error
            )
            self._held = float(np.clip(self._held + change, self._least, self._most))
            self._error = error
        result = u.copy()
        result[self._input] = self._held
        return result
