"""Section 3.3.2, eq. 3.16: order of persistent excitation of the thesis's stimuli."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from demonstrations.thesis.claim import Claim, Entry, Erratum, Illustration
from fmus.kit.arrays import Array
from orchestration.experiment.waveforms import force_staircase, multilevel, square_wave
from orchestration.identify.black_box import CUTOFF, autocovariance_matrix, pexcit
from orchestration.reporting import pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# assumed as in the experiment fig_3_12
DURATION = 600.0  # s
PERIOD = 0.1  # s
LEVELS = (0.5, 1.0, 1.5, 2.0, 2.75)  # N
DWELL = (15.0, 45.0)  # s
BRISK = (1.0, 3.0)  # s, for faster loads
SEEDS = range(9)
SIZE = 50  # of the matrix, the default of `pexcit`
# largest number of samples of a period of tested square waves; finer sampling changes no order
LONGEST = 60
_TEST = "demonstrations/thesis/analyses/test_excitation"
_BLUE = pictures.MODEL
_RED = pictures.FITTED
_GREY = pictures.MEASURED


def entries() -> Iterator[Entry]:
    """Yield claims about the orders of force, current and square waves."""
    current = pexcit(square(0.1))
    force = typical(DWELL)
    highest, period = best_square()
    whole = pexcit(_sampled(20), 1e-9)
    larger = pexcit(_sampled(15), highest=500)
    yield Claim(
        "section 3.3.2, fig. 3-12",
        "order of the current, square wave",
        "20",
        float(current),
        "",
        f"0.9 A at 0.1 Hz and {1 / PERIOD:g} Hz are assumed. Harmonics 1, 3, 5, 7 and 9 are above"
        " the cut-off, each makes 2",
        erratum=44,
    )
    yield Claim(
        "section 3.3.2, fig. 3-12",
        "order of the force, steps",
        "15",
        float(force),
        "",
        f"median of {len(SEEDS)} seeds, loads of {DWELL[0]:g} to {DWELL[1]:g} s are assumed, and"
        f" levels; held for {BRISK[0]:g} to {BRISK[1]:g} s they have {typical(BRISK)}. The times"
        " are not printed",
    )
    yield Claim(
        "section 3.3.2, eq. 3.16",
        "largest order of any square wave",
        "20",
        float(highest),
        "",
        f"cut-off {CUTOFF:g}, matrix of {SIZE}, periods of 2 to {LONGEST} samples; it is that of"
        f" {period} samples",
        erratum=44,
        inferred=True,
    )
    least = min(pexcit(square(frequency)) for frequency in (0.2, 0.15, 0.1))
    yield Claim(
        "section 3.1.4",
        "order of the square waves of table 3-1, for the 3 parameters of eq. 3.10",
        "≥3",
        float(least),
    )
    yield Erratum(
        44,
        "section 3.3.2, eq. 3.16",
        f"the current square wave excites to order 20, with a cut-off at {CUTOFF:g} of the singular"
        " values",
        "the singular values are the powers of its harmonics, which fall with the square of their"
        f" number: 1, 3, 5, 7 and 9 are above {CUTOFF:g}, which makes {current} orders, and coarse"
        f" sampling raises that to {highest} at most, with {period} samples in a period ({larger}"
        " by a matrix of 500, with 30). Where only rounding is cut off, a period of 40 samples has"
        f" order {whole}. A square wave whose frequency or amplitude changes can have more; the"
        " record is lost",
        _TEST,
    )


def square(frequency: float) -> Array:
    """Return a square wave of 0.9 A over ten minutes, (6000,), for a frequency in Hz."""
    return square_wave(PERIOD * np.arange(round(DURATION / PERIOD)), 0.9, frequency)


def _sampled(half: int) -> Array:
    """Return a square wave (6000,) with `half` samples in half a period."""
    return np.resize(np.repeat([1.0, -1.0], half), 6000)


def loads(dwell: tuple[float, float], seed: int) -> Array:
    """Return random levels of the force in N over ten minutes, (6000,).

    Each lasts a random time between the two of `dwell`, in s.
    """
    return multilevel(PERIOD * np.arange(round(DURATION / PERIOD)), LEVELS, dwell, seed)


@cache
def typical(dwell: tuple[float, float]) -> int:
    """Return the median order of random levels of the force over seeds."""
    return int(np.median([pexcit(loads(dwell, seed)) for seed in SEEDS]))


@cache
def best_square() -> tuple[int, int]:
    """Return the largest order of sampled square waves, and the samples in its period."""
    orders = {2 * half: pexcit(_sampled(half)) for half in range(1, LONGEST // 2 + 1)}
    period = max(orders, key=orders.__getitem__)
    return orders[period], period


# --- figures
# --------------------------------------------------------------------------------------------------


def illustrations() -> tuple[Illustration, ...]:
    """Return the figure of the singular values of eq. 3.16."""
    return (
        Illustration(
            "Eq. 3.16: what counts as excitation",
            f"Singular values of the autocovariance matrix of {SIZE} samples at {1 / PERIOD:g} Hz."
            f" Those above the dashed line, {100 * CUTOFF:g} % of the largest, are the order. A"
            " square wave has two for every harmonic; a staircase, slow beside the samples, hardly"
            " any.",
            _singular_values,
        ),
    )


def _singular_values() -> Figure:
    time = PERIOD * np.arange(round(DURATION / PERIOD))
    figure, (axis,) = pictures.panels(1, "Stimuli of chapter 3")
    figure.set_size_inches(9, 4.5)
    for name, values, colour, marker in (
        ("current, ±0.9 A at 0.1 Hz", square(0.1), _BLUE, "o"),
        ("force, random levels of 15 to 45 s", loads(DWELL, 0), _RED, "."),
        ("force, staircase of figs. 3-6 to 3-9", force_staircase(time, 60.0), _GREY, "^"),
    ):
        singular = np.linalg.svd(autocovariance_matrix(values, SIZE), compute_uv=False)
        shares = 100.0 * singular / singular[0]
        axis.semilogy(
            np.arange(1, SIZE + 1),
            shares,
            marker,
            ls="-",
            lw=0.8,
            ms=6,
            mfc="none",
            color=colour,
            label=f"{name}: order {pexcit(values)}",
        )
    axis.axhline(100.0 * CUTOFF, color="black", ls="--", lw=1)
    axis.set_ylim(1e-3, 200.0)
    axis.legend(fontsize=8)
    axis.set_xlabel("singular value [number]")
    pictures.label(axis, "share of the largest", "%")
    return figure
