"""Records of the emulated rig with hidden variations drawn at random.

The size of a variation is chosen for the residual that it leaves in the base physics with refitted
parameters. It is measured in *noise widths*: the RMS of the residual over the standard deviation of
the noise, in the output where that is largest.
"""

from __future__ import annotations

import hashlib
import pickle
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from demonstrations.bench import NOISE, Bench
from demonstrations.emulator import VARIATIONS, EmulatedRig, RigParameters, Variation, together
from fmus.kit.storage import cached_file
from orchestration.records import write_record

Array = NDArray[np.float64]
UNITS = {"current": "A", "force": "N", "voltage": "V", "displacement": "m"}
_WIDTHS = (1.3, 20.0)  # noise widths of strength 1
_CLOSE = 0.05  # relative tolerance of the wanted number of noise widths
_STEPS = 15  # of the search for a size
_TRIES = 60  # draws until a variation is given up


@dataclass(frozen=True)
class Hidden:
    """A variation that is hidden in a record, with its parameters.

    Attributes
    ----------
    id, output : str
        Id of the variation, and the measured output that it affects, empty if that is no choice.
    parameters : dict
        Parameters of its physics, SI.
    wanted, widths : float
        Noise widths of this variation alone in the refitted base, as wanted and as reached.
    alike : bool
        Whether other parameters of the base have the same effect; `wanted` is then not a number.
    """

    id: str
    output: str
    parameters: dict[str, float | str | int]
    wanted: float
    widths: float
    alike: bool


@dataclass(frozen=True)
class Truth:
    """True values of a record: hidden variations, parameters, outputs without noise.

    Attributes
    ----------
    hidden : tuple of Hidden
    parameters : RigParameters
    outputs : dict of str to ndarray, shape (n,)
        Outputs without noise.
    widths : dict of str to float
        Noise widths of the refitted base in every output.
    """

    hidden: tuple[Hidden, ...]
    parameters: RigParameters
    outputs: dict[str, Array]
    widths: dict[str, float]

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of the hidden variations."""
        return tuple(hidden.id for hidden in self.hidden)


@dataclass(frozen=True)
class Drawn:
    """A drawn record: time (s), inputs and measured outputs of shape (n,) in SI, and the truth."""

    time: Array
    inputs: dict[str, Array]
    outputs: dict[str, Array]
    truth: Truth


def draw(
    hidden: str | tuple[str, ...] | None,
    seed: int,
    *,
    strength: float = 1.0,
    noise_colour: float = 0.0,
    duration: float = 600.0,
    rate: float = 10.0,
    outputs: tuple[str, ...] = ("voltage", "displacement"),
    at_rest: bool = True,
    changed: Mapping[str, float] | None = None,
    spread: float = 0.15,
) -> Drawn:
    """Draw a record.

    Parameters
    ----------
    hidden : str, tuple of str, or None
        Ids of `VARIATIONS`; ``"sensor_lag.voltage"`` also chooses the output.
    seed : int
        Seed of all random numbers.
    strength : float
        Factor of the noise widths, which are 1.3 to 20 at strength 1, log-uniformly distributed, if
        plausible sizes reach them.
    noise_colour : float
        Lag-one correlation of the noise.
    duration, rate : float
        s, Hz.
    outputs : tuple of str
        Measured outputs.
    at_rest : bool
        Whether the record begins at rest, or after some minutes of operation.
    changed : Mapping[str, float], optional
        Factors of nominal values, by parameter; these parameters are not drawn.
    spread : float
        Largest relative deviation of the other parameters, which are uniformly distributed.

    Returns
    -------
    Drawn

    Raises
    ------
    ValueError
        If a variation is unknown, or too small on these outputs at any plausible size.
    """
    ids = (hidden,) if isinstance(hidden, str) else hidden or ()
    for name in ids:
        if name.partition(".")[0] not in VARIATIONS:
            raise ValueError(f"no hidden variation {name!r}; there are {', '.join(VARIATIONS)}")
    for attempt in range(_TRIES):
        random = np.random.default_rng([seed, zlib.crc32(repr(ids).encode()), attempt])
        specimen = {
            n: _between(random, *ends)
            for name in ids
            for n, ends in _variation(name)[0].specimen.items()
        }
        bench = Bench.drawn(
            random,
            duration,
            rate,
            outputs,
            at_rest=at_rest,
            changed=specimen | dict(changed or {}),
            spread=spread,
        )
        variations = _draw_sizes(ids, bench, strength, random)
        if variations is not None:
            return _measure(bench, variations, noise_colour, int(random.integers(2**31)))
    raise ValueError(
        f"{' and '.join(ids)}: leaves too little in {', '.join(outputs)} at any plausible size"
    )


def draw_cached(
    folder: Path | None, hidden: str | tuple[str, ...] | None, seed: int, **options: Any
) -> Drawn:
    """Draw a record, or read it from a cache of this version of the code.

    Parameters
    ----------
    folder : Path or None
        Folder of the cache, which belongs to this user; None for no cache.
    hidden, seed, **options
        As in `draw`.

    Returns
    -------
    Drawn
    """
    if folder is None:
        return draw(hidden, seed, **options)
    name = _digest(repr((hidden, seed, sorted(options.items()))))
    file = cached_file(
        f"{name}.pickle", lambda: pickle.dumps(draw(hidden, seed, **options)), folder
    )
    kept: Drawn = pickle.loads(file.read_bytes())
    return kept


def write(drawn: Drawn, path: str | Path) -> None:
    """Write time, inputs and measured outputs as CSV, without the truth."""
    write_record(path, drawn.time, drawn.inputs | drawn.outputs, UNITS)


def _measure(bench: Bench, hidden: list[Hidden], noise_colour: float, seed: int) -> Drawn:
    """Return the record of a bench with hidden variations and noise."""
    kind = together([_variation(h.id)[0].physics for h in hidden])
    values = {name: value for h in hidden for name, value in h.parameters.items()}
    physics = partial(kind, **values)  # type: ignore[arg-type]
    rig = EmulatedRig(
        bench.parameters,
        seed,
        NOISE["voltage"],
        NOISE["displacement"],
        noise_colour,
        hidden=physics,
    )
    measured = rig.run(bench.time, bench.current, bench.force)
    part = slice(bench.lead, None)
    noise_free = {output: rig.truth[output][part] for output in bench.outputs}
    return Drawn(
        bench.time[part],
        {"current": bench.current[part], "force": bench.force[part]},
        {output: measured[output][part] for output in bench.outputs},
        Truth(tuple(hidden), bench.parameters, noise_free, bench.widths(noise_free)),
    )


def _variation(name: str) -> tuple[Variation, str]:
    """Return the variation of an id, and the output in the id, empty if it has none."""
    identity, _, output = name.partition(".")
    return VARIATIONS[identity], output


def _draw_sizes(
    ids: tuple[str, ...], bench: Bench, strength: float, random: np.random.Generator
) -> list[Hidden] | None:
    """Draw variations of several ids; None if one has no size for the wanted noise widths."""
    variations = []
    for name in ids:
        sized = _draw_size(name, bench, strength, random)
        if sized is None:
            return None
        variations.append(sized)
    return variations


def _draw_size(
    name: str, bench: Bench, strength: float, random: np.random.Generator
) -> Hidden | None:
    """Draw a variation, with a size for the wanted noise widths; None if there is no such size."""
    variation, output = _variation(name)
    choices = [o for o in variation.limits if (not o or o in bench.outputs) and output in ("", o)]
    if not output and any(o not in variation.alike for o in choices):
        choices = [o for o in choices if o not in variation.alike]
    if not choices:
        return None
    output = str(random.choice(choices))
    values: dict[str, float | str | int] = {
        n: _between(random, *ends) for n, ends in variation.ranges.items()
    }
    values |= {variation.output: output} if variation.output else {}
    values |= {variation.seed: int(random.integers(2**31))} if variation.seed else {}
    sign = float(random.choice([-1.0, 1.0])) if variation.signed else 1.0
    limit = variation.limits[output]

    def widths(size: float) -> float:
        physics = partial(variation.physics, **(values | {variation.size: sign * size}))  # type: ignore[arg-type]
        return max(bench.widths(bench.noise_free(physics)).values())

    alike = output in variation.alike
    wanted = float("nan")
    size: float | None = strength * _between(random, 0.1 * limit, limit)
    if not alike:
        most = widths(limit)
        least = widths(variation.least * limit) if variation.least else 0.0
        low, high = max(_WIDTHS[0], least / strength), min(_WIDTHS[1], most)
        if not low < high:
            return None
        wanted = strength * _between(random, low, high)
        size = _search(widths, wanted, limit, most)
    if size is None or size <= variation.above_bias * bench.force.min():
        return None
    values[variation.size] = sign * size
    return Hidden(name.partition(".")[0], output, values, wanted, widths(size), alike)


def _search(
    widths: Callable[[float], float], wanted: float, limit: float, most: float
) -> float | None:
    """Return the size, at most the limit, for nearly the wanted widths; None if there is none.

    The widths are nearly a power of the size. Steps follow that power, or else halve the bracket of
    the logarithm.
    """
    low = 0.0
    high = limit
    power = 1.0
    before = (limit, most)
    for _ in range(_STEPS):
        size = before[0] * (wanted / before[1]) ** (1 / power)
        if low and not low < size < high:
            size = float(np.sqrt(low * high))
        width = widths(size)
        if abs(width / wanted - 1) <= _CLOSE:
            return size
        low, high = (size, high) if width < wanted else (low, size)
        if high < 1.001 * low:
            return None  # a jump
        power = float(np.clip(np.log(width / before[1]) / np.log(size / before[0]), 0.3, 3.0))
        before = size, width
    return None


def _between(random: np.random.Generator, low: float, high: float) -> float:
    """Draw a log-uniform number, or a uniform one if the range starts at zero."""
    if low > 0:
        return float(np.exp(random.uniform(np.log(low), np.log(high))))
    return float(random.uniform(low, high))


def _digest(arguments: str) -> str:
    """Return a digest of the arguments and of the code that draws records."""
    here = Path(__file__).parent
    files = here / "bench.py", here / "records.py", *sorted(here.glob("emulator/*.py"))
    code = b"".join(file.read_bytes() for file in files)
    return hashlib.sha256(code + arguments.encode()).hexdigest()[:24]
