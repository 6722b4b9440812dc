"""Assessment of the quality of data before any model is fitted: faults of every channel.

The faults are clipped, stuck and dead outputs, inputs that do not change, outliers, and a coarse
resolution. No simulation is needed. Noise seldom repeats a value, so the recorder causes long runs
of equal samples: at an end of the range the signal is clipped, elsewhere the sensor is stuck. An
output without noise may rest; it is clipped only if it is cut while it changes, and dead only if it
stops while inputs change.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.special import ndtri

from fmus.kit import UserError
from fmus.kit.arrays import Array, Indices, Mask, Signals
from orchestration.records.quality.fault import FAULTS, Channels, Fault
from orchestration.records.sampling import true_runs

Span = tuple[int, int]  # first sample, and the one after the last
_SAME = 1e-9  # of the range: what unit conversion may split one value into
_RUN = 5  # equal samples that are looked at
_REPEATS = ("stuck", "standing")  # kinds of runs of equal samples within the range
_USABLE = 0.1  # share of the samples below which an output is not used
_HUGE = 1e30  # no measurement is that large, and its square is still a number
_TINY = 1e-100  # nor is any that small, likewise

# Noise
_ROUGH = 3.0  # standard deviations of noise in the median modulus of its third differences
_QUIET = 30  # samples without steps of the inputs that it takes to know the noise
# share of repeated samples above which the noise is too small for the steps of the recorder
_COARSE = 0.4
_FINE = 0.01  # likewise while inputs move smoothly
# different values at which a channel with noise may stand still: both ends, and where a sensor
# hangs
_LEVELS = 4
_ALARM = 1e-6  # probability, for a whole channel, of so long a run of equal samples in noise
_COLOURED = 1.5  # times as long as if noise forgot from sample to sample

# Runs of equal samples
# samples between masked ones that are masked too: those that noise spared are no fair sample
_CLOSED = 5
_BESIDE = 3.5  # steps of the recorder that are beside an end
_JUMP = 2.0  # times the largest change from sample to sample elsewhere: so a sensor comes back
_SLOW = 0.3  # of the usual change from sample to sample, below which something comes to rest
_DEAD = 0.05  # share of a record for which an output without noise must stand still to be dead

# Outliers
_SPIKE = 12.0  # standard deviations by which a single sample must leave its neighbours
_SPIKES = 0.02  # share of the samples above which they are no outliers


@dataclass(frozen=True)
class _Symptom:
    """A fault that the samples of one output show.

    Attributes
    ----------
    code : str
        See `Fault`.
    mask : ndarray of bool, shape (n,)
        The samples.
    facts : Mapping of str to Any
        Figures that its sentence needs.
    """

    code: str
    mask: Mask
    facts: Mapping[str, Any] = field(default_factory=dict)

    @property
    def kind(self) -> str:
        return FAULTS[self.code].kind

    def fault(self, channel: str, values: Array) -> Fault:
        """Return the fault of a channel of values (n,)."""
        share = float(self.mask.sum() / max(np.isfinite(values).sum(), 1))
        return Fault(self.code, channel, {**self.facts, "share": share})


class _Moves(NamedTuple):
    """Samples at which inputs change.

    Attributes
    ----------
    each : dict of str to ndarray of bool, shape (n,)
        Where each input changes.
    stepped : ndarray of bool, shape (n,)
        Where any changes that is not smooth. The bends of a smooth input are smaller than its
        changes, as of a sine of more than six samples a period.
    """

    each: dict[str, Mask]
    stepped: Mask

    @classmethod
    def of(cls, inputs: Signals, count: int) -> _Moves:
        """Return the samples, of `count`, at which the inputs change."""
        each = {name: _changes(u) for name, u in inputs.items()}
        rough = [
            each[name]
            for name, u in inputs.items()
            if np.sum(np.diff(u, 2) ** 2) >= np.sum(np.diff(u) ** 2)
        ]
        return cls(each, np.any(rough, axis=0) if rough else np.zeros(count, dtype=bool))

    def at(self, chosen: Indices) -> _Moves:
        """Return the changes at chosen samples only."""
        return _Moves({n: mask[chosen] for n, mask in self.each.items()}, self.stepped[chosen])


def check_sizes(channels: Channels) -> None:
    """Refuse values so large or small that their squares overflow or underflow.

    This comes before any computation with a record.

    Raises
    ------
    UserError
    """
    for name, values in (*channels.inputs.items(), *channels.outputs.items()):
        largest = np.abs(values[np.isfinite(values)]).max(initial=0.0)
        if largest > _HUGE:
            raise UserError(f"{name}: values beyond {_HUGE:g} are no measurement")
        if 0.0 < largest < _TINY:
            raise UserError(f"{name}: values all within {_TINY:g} of zero are no measurement")


def assess(channels: Channels, simulated: Signals | None = None) -> tuple[Channels, list[Fault]]:
    """Look for faults of the data.

    Parameters
    ----------
    channels : Channels
    simulated : Mapping of str to ndarray, shape (n,), optional
        Outputs of a model with the same inputs. A symptom that they have too, such as rest at a
        limit, is no fault of the data.

    Returns
    -------
    Channels
        With NaN where an output is faulty, and without outputs that carry no signal.
    list of Fault
        In the order of the channels, inputs first.
    """
    moves = _Moves.of(channels.inputs, len(channels.time))
    faults = list(_still_inputs(channels))
    modelled = simulated or {}
    usable = {}
    for name, values in channels.outputs.items():
        bad = np.zeros(len(values), dtype=bool)
        for symptom in _beside_model(values, modelled.get(name), channels.inputs, moves):
            fault = symptom.fault(name, values)
            faults.append(fault)
            if not fault.is_evidence:
                bad |= symptom.mask
        present = np.isfinite(values)
        share = float((present & ~bad).sum() / max(present.sum(), 1))
        if share >= _USABLE:
            usable[name] = np.where(bad, np.nan, values)
        elif share > 0.0:
            unusable = _Symptom("unusable", present, {"usable": share})
            faults.append(unusable.fault(name, values))
    if not usable:
        faults.append(_of_record("nothing_usable", channels))
    return replace(channels, outputs=usable), faults


def _beside_model(
    values: Array, simulated: Array | None, inputs: Signals, moves: _Moves
) -> Iterator[_Symptom]:
    """Yield the faults of one output (n,) that its simulation, if there is one, does not have."""
    symptoms = [*_copies(values, inputs), *_symptoms(values, moves)]
    if simulated is None:
        yield from symptoms
        return
    of_model = {x.kind for x in (*_copies(simulated, inputs), *_symptoms(simulated, moves))}
    resolution = resolution_of(values)
    for symptom in symptoms:
        beside = symptom
        if symptom.kind in _REPEATS:
            beside = _where_model_moves(symptom, simulated, resolution)
        if symptom.kind not in of_model and beside.mask.any():
            yield beside


def _where_model_moves(symptom: _Symptom, simulated: Array, resolution: float) -> _Symptom:
    """Return the part of a run of equal samples in which the simulation exceeds the resolution."""
    spans = true_runs(symptom.mask)
    moving = [span for span in spans if not np.ptp(simulated[span[0] : span[1]]) <= resolution]
    if len(moving) == len(spans) or not moving:
        return replace(symptom, mask=_mask(len(simulated), moving))
    first, last = _longest(moving)
    facts = {**symptom.facts, "samples": last - first}
    return replace(symptom, mask=_mask(len(simulated), moving), facts=facts)


def resolution_of(values: Array) -> float:
    """Return the resolution of a channel: the least step between different values.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Any unit; NaN is a gap.

    Returns
    -------
    float
        In the same unit; 0 for a constant.
    """
    known = values[np.isfinite(values)]
    spread = float(np.ptp(known)) if known.size else 0.0
    steps = np.diff(np.unique(known))
    steps = steps[steps > _SAME * spread]
    return float(steps.min()) if len(steps) else 0.0


def _of_record(code: str, channels: Channels) -> Fault:
    """Return a fault of all channels together."""
    return _Symptom(code, _everywhere(channels.time)).fault("", channels.time)


def _still_inputs(channels: Channels) -> Iterator[Fault]:
    """Yield a fault for every constant input, and one more if all are constant."""
    still = {name: u for name, u in channels.inputs.items() if not _changes(u).any()}
    for name, values in still.items():
        facts = {"value": float(values[0])}
        yield _Symptom("constant_input", _everywhere(values), facts).fault(name, values)
    if len(still) == len(channels.inputs):
        yield _of_record("no_excitation", channels)


def _copies(values: Array, inputs: Signals) -> Iterator[_Symptom]:
    """Yield a symptom if an output (n,) has the values of an input."""
    for name, u in inputs.items():
        if np.ptp(u) > 0.0 and np.allclose(values, u, rtol=0.0, atol=_SAME * float(np.ptp(u))):
            yield _Symptom("copied", _everywhere(values), {"input": name})
            return


def _symptoms(values: Array, moves: _Moves) -> Iterator[_Symptom]:
    """Yield the faults of one output (n,), given the changes of the inputs."""
    present = np.flatnonzero(np.isfinite(values))
    for symptom in _symptoms_without_gaps(values[present], moves.at(present)):
        whole = np.zeros(len(values), dtype=bool)
        whole[present[symptom.mask]] = True
        yield replace(symptom, mask=whole)


def _symptoms_without_gaps(y: Array, moves: _Moves) -> Iterator[_Symptom]:
    n = len(y)
    moved = moves.each
    if n < 2 * _RUN:
        return
    resolution = resolution_of(y)
    dead = _dead_throughout(y, resolution, moved)
    if dead:
        yield dead
        return
    tie_probability = _tie_probability(y, resolution, moves)
    bad = np.zeros(n, dtype=bool)
    for symptom in _repeated_values(y, resolution, tie_probability, moved):
        bad |= symptom.mask
        yield symptom
    is_noisy = tie_probability is not None
    coarse = not is_noisy and 4 * len(np.unique(y)) <= n and is_on_grid(y, resolution)
    spikes = _outliers(y, resolution, bad, moved)
    if (coarse or is_noisy) and 0 < spikes.sum() <= max(1, _SPIKES * n):
        yield _Symptom("outliers", spikes, {"count": int(spikes.sum())})
    if coarse and _roughness(y, ~bad, _equal_runs(y)) <= _ROUGH * resolution:
        yield _Symptom("quantised", _everywhere(y), {"resolution": resolution})


def _dead_throughout(y: Array, resolution: float, moved: Mapping[str, Mask]) -> _Symptom | None:
    """Return the symptom of an output that carries no signal while inputs change, or None."""
    inputs = _any_moved(moved, len(y))
    if not inputs.any():
        return None
    if resolution == 0.0:
        return _Symptom("dead_constant", _everywhere(y), {"level": float(y[0])})
    changes = np.flatnonzero(np.diff(y)) + 1
    near_move = inputs | np.roll(inputs, 1) | np.roll(inputs, -1)
    if (
        np.ptp(y) < 2.5 * resolution
        and len(changes)
        and not near_move.all()
        and near_move[changes].mean() < 0.5
    ):
        return _Symptom("dead_toggling", _everywhere(y), {"resolution": resolution})
    return None


def _tie_probability(y: Array, resolution: float, moves: _Moves) -> float | None:
    """Return the probability that noise repeats a sample; None without measurable noise.

    It is estimated where no input changes, or else where none steps. In the latter case a slow
    signal repeats values of a coarse recorder too, so that only a small probability is evidence of
    noise.
    """
    equal = _equal_runs(y)
    if len({float(y[first]) for first, last in equal if last - first >= 4 * _RUN}) > _LEVELS:
        return None
    at_rest = _ties(y, resolution, ~_any_moved(moves.each, len(y)), equal)
    if at_rest is not None:
        return at_rest if at_rest < _COARSE else None
    smooth = _ties(y, resolution, ~moves.stepped, equal)
    return smooth if smooth is not None and smooth < _FINE else None


def _ties(y: Array, resolution: float, still: Mask, equal: Sequence[Span]) -> float | None:
    """Return the share of samples of a mask (n,) that repeat the sample before; None without noise.

    Runs of at least `_RUN` equal samples do not count.
    """
    if _roughness(y, still, equal) < max(2.0 * resolution, _TINY):
        return None
    ties = float(np.mean(np.diff(y)[2:][_quiet(still, equal)] == 0.0))
    return max(ties, 1.0 / len(y))


def _quiet(still: Mask, equal: Sequence[Span]) -> Mask:
    """Return the third differences (n - 3,) within a mask (n,), but not in long equal runs."""
    judged = still.copy()
    for span in equal:
        judged[slice(*span)] &= _length(span) < _RUN  # a long run may be the fault itself
    return judged[1:-2] & judged[2:-1] & judged[3:]


def _roughness(y: Array, still: Mask, equal: Sequence[Span]) -> float:
    """Return the median modulus of third differences in a mask (n,); zero without noise.

    Third differences of noise alternate in sign, those of a smooth signal do not.
    """
    third = np.diff(y, 3)[_quiet(still, equal)]
    signs = np.sign(third[third != 0.0])
    if len(signs) < _QUIET or np.mean(signs[1:] != signs[:-1]) < 0.6:
        return 0.0
    return float(np.median(np.abs(third)))


def _repeated_values(
    y: Array, resolution: float, tie_probability: float | None, moved: Mapping[str, Mask]
) -> Iterator[_Symptom]:
    """Yield the faults that repeat a value of an output: clipped, stuck, dead or standing still.

    The criterion is the probability that noise repeats a sample or, without noise, the course of
    output and inputs.
    """
    if tie_probability is None:
        return _repeats_without_noise(y, resolution, moved)
    return _repeats_in_noise(y, resolution, tie_probability)


def _repeats_in_noise(y: Array, resolution: float, tie_probability: float) -> Iterator[_Symptom]:
    """Yield the faults whose values repeat more often than noise explains.

    Parameters
    ----------
    y : ndarray, shape (n,)
        An output, any unit, without gaps.
    resolution : float
        Least step between different values, in its unit.
    tie_probability : float
        Probability that its noise repeats a sample.

    Yields
    ------
    _Symptom
    """
    same = _SAME * float(np.ptp(y))
    longest = 1.0 + _COLOURED * np.log(_ALARM / len(y)) / np.log(tie_probability)
    frozen = [(first, last) for first, last in _equal_runs(y) if last - first >= max(_RUN, longest)]
    tail = _dead_tail(y, frozen, same)
    if tail:
        mask = _mask(len(y), [tail])
        yield _Symptom("dead_to_the_end", mask, {"level": float(y[-1])})
        frozen.remove(tail)
    for end, level in (("maximum", float(y.max())), ("minimum", float(y.min()))):
        facts = {"end": end, "level": level}
        distance = np.abs(y - level)
        at_level = distance <= same
        beside = int(((distance > same) & (distance < _BESIDE * resolution)).sum())
        dead_there = tail is not None and abs(y[-1] - level) <= same
        # at the end of what noise reaches there are fewer samples than beside it
        if at_level.sum() > _RUN + _BESIDE * beside and not dead_there:
            yield _Symptom("clipped", _closed(at_level), facts)
            frozen = [span for span in frozen if not at_level[span[0]]]
    yield from _stuck_or_standing(y, frozen, same)


def _dead_tail(y: Array, frozen: Sequence[Span], same: float) -> Span | None:
    """Return the run of equal samples at the end; None if the same value occurs before."""
    n = len(y)
    for first, last in frozen:
        if last == n and last - first >= _DEAD * n:
            stood_before = any(abs(y[start] - y[-1]) <= same for start, _ in frozen[:-1])
            return None if stood_before else (first, last)
    return None


def _stuck_or_standing(y: Array, frozen: Sequence[Span], same: float) -> Iterator[_Symptom]:
    """Yield the runs of a stuck sensor, and those of a plant at rest.

    A plant rests where it has rested before; a sensor gets stuck anywhere.
    """
    stuck = []
    standing = []
    for first, last in frozen:
        stood_before = any(
            abs(y[other] - y[first]) <= same for other, _ in frozen if other != first
        )
        if stood_before:
            standing.append((first, last))
        else:
            stuck.append((first, last))
    if stuck:
        samples = _mask(len(y), stuck)
        first, last = _longest(true_runs(samples))
        yield _Symptom("stuck", samples, {"samples": last - first})
    if standing:
        samples = _mask(len(y), standing)
        first, last = _longest(true_runs(samples))
        facts = {"level": float(y[first]), "samples": last - first}
        yield _Symptom("stands_still", samples, facts)


def _repeats_without_noise(
    y: Array, resolution: float, moved: Mapping[str, Mask]
) -> Iterator[_Symptom]:
    """Yield cuts and standstills of an output without noise.

    Parameters
    ----------
    y : ndarray, shape (n,)
        An output, any unit, without gaps.
    resolution : float
        Least step between different values, in its unit.
    moved : Mapping of str to ndarray of bool, shape (n,)
        Where each input has changed.

    Yields
    ------
    _Symptom
    """
    equal = _equal_runs(y)
    if not equal:
        return
    longest = _longest(equal)
    if _stops_while_driven(longest, equal, moved, len(y)):
        yield _standstill(y, longest, longest in _spans_at_rest(y, equal))
        equal.remove(longest)
    same = _SAME * np.ptp(y)
    low = np.abs(y - y.min()) <= same
    high = np.abs(y - y.max()) <= same
    usual = max((_length(span) for span in equal if not (low | high)[span[0]]), default=_RUN)
    varied = len(np.unique(y)) > 10 and (low | high).mean() < 0.5
    for end, at_level, sign in (("maximum", high, 1.0), ("minimum", low, -1.0)):
        spans = [span for span in equal if _length(span) >= _RUN and at_level[span[0]]]
        level = float(y[at_level][0])
        cuts = sum(_is_cut(sign * y, sign * level, span, resolution, moved) for span in spans)
        long = sum(_length(span) > 1.5 * usual for span in spans) if varied else 0
        if (cuts >= 2 and 2 * cuts >= len(spans)) or long >= 3:
            facts = {"end": end, "level": level, "times": len(spans)}
            yield _Symptom("clipped_repeatedly", _closed(at_level), facts)


def _stops_while_driven(
    span: Span, equal: Sequence[Span], moved: Mapping[str, Mask], n: int
) -> bool:
    """Return True if a standstill is far longer than others although the inputs still change."""
    first, last = span
    if last - first < max(_DEAD * n, 4 * _RUN):
        return False
    elsewhere = [mask for mask in moved.values() if mask[:first].any() or mask[last:].any()]
    if not elsewhere or not all(mask[first + 1 : last].sum() > 1 for mask in elsewhere):
        return False
    inputs = _any_moved(moved, n)
    others = [
        end - start for start, end in equal if start != first and inputs[start + 1 : end].any()
    ]
    return last - first > 3 * max(others, default=0)


def _standstill(y: Array, span: Span, at_rest: bool) -> _Symptom:
    """Return the symptom of a standstill: of a plant at rest, or of a dead or stuck sensor."""
    first, last = span
    mask = _mask(len(y), [span])
    facts = {"level": float(y[first]), "samples": last - first}
    if at_rest:
        return _Symptom("stands_still", mask, facts)
    if last == len(y):
        return _Symptom("dead_while_driven", mask, facts)
    return _Symptom("stuck_while_driven", mask, facts)


def _is_cut(
    y: Array, level: float, span: Span, resolution: float, moved: Mapping[str, Mask]
) -> bool:
    """Return True if a signal was rising beyond its maximum, and no input explains its stop.

    Parameters
    ----------
    y : ndarray, shape (n,)
    level : float
        Its maximum.
    span : tuple of int
        Samples at that maximum.
    resolution : float
        Least step between different values.
    moved : Mapping of str to ndarray of bool, shape (n,)
        Where each input has changed.
    """
    first, last = span
    if first < 2 or 2.0 * y[first - 1] - y[first - 2] - level <= resolution:
        return False
    return not any(
        mask[first - 1 : first + 1].any() and not mask[first + 2 : last].any()
        for mask in moved.values()
    )


def _spans_at_rest(y: Array, equal: Sequence[Span]) -> set[Span]:
    """Return the runs of equal samples in which a plant may be at rest.

    A plant rests in a dead zone, held by dry friction, or at a stop: where it rested before, at an
    end of its range, or after it slowed down; and it continues from there. A stuck or dead sensor
    stops anywhere, and its signal jumps when it recovers.

    Parameters
    ----------
    y : ndarray, shape (n,)
        An output, any unit, without gaps.
    equal : sequence of tuple of int
        Its runs of equal samples, as :func:`_equal_runs` has them.
    """
    change = np.abs(np.diff(y))
    same = _SAME * float(np.ptp(y))
    spans = [span for span in equal if _length(span) >= _RUN]
    at_edge = np.zeros(change.size, dtype=bool)
    for span in spans:
        at_edge[_edges(span, change.size)] = True
    usual = change[~at_edge & (change > same)]
    largest = float(usual.max()) if usual.size else np.inf
    typical = float(np.median(usual)) if usual.size else 0.0
    at_rest = set()
    for span in spans:
        first = span[0]
        jumps = any(change[k] > _JUMP * largest for k in _edges(span, change.size))
        rested_there = any(abs(y[start] - y[first]) <= same for start, _ in spans if start != first)
        at_end = min(y[first] - y.min(), y.max() - y[first]) <= same
        slowed_down = first > 0 and change[max(first - _RUN, 0) : first].mean() < _SLOW * typical
        if not jumps and (first == 0 or rested_there or at_end or slowed_down):
            at_rest.add(span)
    return at_rest


def _edges(span: Span, changes: int) -> list[int]:
    """Return the indices, below `changes`, of the changes that enter and leave a run."""
    return [k for k in (span[0] - 1, span[1] - 1) if 0 <= k < changes]


def _length(span: Span) -> int:
    return span[1] - span[0]


def _longest(spans: Sequence[Span]) -> Span:
    return max(spans, key=_length)


def _equal_runs(y: Array) -> list[Span]:
    """Return the runs of equal samples of a signal (n,)."""
    same = np.abs(np.diff(y)) <= _SAME * np.ptp(y)
    return [(first, last + 1) for first, last in true_runs(same)]


def _outliers(y: Array, resolution: float, bad: Mask, moved: Mapping[str, Mask]) -> Mask:
    """Return a mask of single samples far from two equal neighbours, where no input changes."""
    distance = np.abs(y[1:-1] - 0.5 * (y[:-2] + y[2:]))
    good = distance[~bad[1:-1]]
    robust = float(np.median(good)) / float(ndtri(0.75)) if good.size else 0.0
    is_far = distance > _SPIKE * max(robust, resolution)
    neighbours_agree = np.abs(y[2:] - y[:-2]) < 0.25 * distance
    alone = is_far & neighbours_agree
    still = ~_any_moved(moved, len(y))
    result = np.zeros(len(y), dtype=bool)
    result[1:-1] = alone & still[:-2] & still[1:-1] & still[2:]
    return result & ~bad


def is_on_grid(y: Array, resolution: float) -> bool:
    """Return True if all values are whole multiples of a resolution apart."""
    steps = np.diff(np.unique(y)) / resolution
    return bool(np.abs(steps - np.round(steps)).max(initial=0.0) < 0.01)


def _changes(values: Array) -> Mask:
    """Return a mask of the samples that differ from the sample before."""
    change = np.abs(np.diff(values, prepend=values[:1]))
    return change > _SAME * np.abs(values).max(initial=0.0)


def _any_moved(moved: Mapping[str, Mask], n: int) -> Mask:
    """Return a mask (n,) of the samples at which any input changes."""
    return np.any(list(moved.values()), axis=0) if moved else np.zeros(n, dtype=bool)


def _everywhere(values: Array) -> Mask:
    return np.ones(len(values), dtype=bool)


def _mask(n: int, spans: Sequence[Span]) -> Mask:
    """Return a mask (n,) of the samples in any of the spans."""
    result = np.zeros(n, dtype=bool)
    for first, last in spans:
        result[first:last] = True
    return result


def _closed(mask: Mask) -> Mask:
    """Fill short holes of a mask."""
    result = mask.copy()
    for first, last in true_runs(~mask):
        if first > 0 and last < len(mask) and last - first <= _CLOSED:
            result[first:last] = True
    return result
