"""Linear model: a state-space model with names, units, poles and stability margins."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf, pi
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fmus.kit import files, quoting
from fmus.kit.arrays import Array
from fmus.kit.errors import UserError, find
from fmus.kit.extras import optional
from fmus.kit.interrupt import uninterrupted
from orchestration.linear.discretisation import Matrices
from orchestration.linear.operating_point import OperatingPoint, with_unit
from orchestration.linear.poles import poles_table
from orchestration.reporting import Displayable, one_line, plain_table

if TYPE_CHECKING:
    import control
    from rich.console import RenderableType

_MATLAB = ".mat"
FAMILY = 8  # most variations of parameters that are shown one by one; more are a band
_NOTES_BESIDE = 3  # notes on other operating points and variations that are printed
_UNITY = 1e-6  # largest error of the gain at a crossover
_POINTS = 4000  # frequencies between which margins are interpolated
_DECADES = 1.0  # of frequencies beyond the slowest and the fastest pole or zero
FAR = 100.0  # times the fastest pole, beyond which a zero has no visible effect
_FLOOR = 1e-6  # times the fastest pole or zero, below which one belongs to an integrator


class LoopMargins(NamedTuple):
    """Stability margins of a loop.

    Attributes
    ----------
    phase : float
        Phase margin, degrees; infinite without a crossover.
    crossover : float
        Frequency of gain one, Hz, or NaN.
    gain : float
        Factor by which the gain may grow; infinite without a limit.
    phase_crossover : float
        Frequency of phase -180 degrees, Hz, or NaN.
    """

    phase: float
    crossover: float
    gain: float
    phase_crossover: float


@dataclass(frozen=True)
class LinearModel(Displayable):
    """A linear model about an operating point.

    Attributes
    ----------
    name : str
        Name of the component, FMU or system.
    matrices : Matrices
    inputs, outputs : tuple of str
    units : dict of str to str
        Unit by input, output and state.
    point : OperatingPoint
    method : str
        Origin of the derivatives: the laws, an FMU, or differences.
    loop : str
        Signal at which a loop is cut, if this is its loop transfer function; else empty.
    notes : tuple of str
        Remarks for the user.
    further : tuple of LinearModel
        Models at other operating points.
    variations : tuple of LinearModel
        Models with other values of parameters and inputs, a family or a band.
    case : dict of str to float
        Those values, of a variation.
    """

    name: str
    matrices: Matrices
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    units: dict[str, str]
    point: OperatingPoint
    method: str
    loop: str = ""
    notes: tuple[str, ...] = ()
    further: tuple[LinearModel, ...] = ()
    variations: tuple[LinearModel, ...] = ()
    case: dict[str, float] = field(default_factory=dict)

    @property
    def words(self) -> str:
        """Text for tables and legends: the operating point, or the values of a variation."""
        values = [
            f"{name} = {with_unit(f'{value:.6g}', self.units.get(name))}"
            for name, value in self.case.items()
        ]
        return ", ".join(values) or self.point.words

    @property
    def beside(self) -> tuple[LinearModel, ...]:
        """Models that are shown beside this one: other operating points, and a small family."""
        family = self.variations if len(self.variations) <= FAMILY else ()
        return (*self.further, *family)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return self.matrices.states

    @property
    def _names(self) -> dict[str, tuple[str, ...]]:
        """Names of inputs, states and outputs."""
        return {"inputs": self.inputs, "states": self.states, "outputs": self.outputs}

    @property
    def period(self) -> float:
        """Sample period in s; 0 of a continuous model."""
        return self.matrices.period

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes that are copied and pickled."""
        # a StateSpace of python-control cannot be pickled, and is derived again
        return {name: value for name, value in vars(self).items() if name != "state_space"}

    @cached_property
    def state_space(self) -> control.StateSpace:
        """The model as a system of python-control.

        Full stops, which are not allowed in its names, become slashes: ``bench/tension``.
        """
        with optional(), uninterrupted():  # it loads matplotlib, which ignores a Ctrl-C
            import control

        matrices = self.matrices.by_name.values()
        names = {kind: quoting.control(names) for kind, names in self._names.items()}
        return control.StateSpace(*matrices, self.period, **names, remove_useless_states=False)

    def part(self, input: str = "", output: str = "") -> control.StateSpace:
        """Return the system from one input to one output.

        Parameters
        ----------
        input, output : str
            The first ones if empty.

        Raises
        ------
        UserError
            If there is no such input or output.
        """
        j = _index(input, self.inputs, "input")
        i = _index(output, self.outputs, "output")
        return self.state_space[i, j]

    def between(self, inputs: Sequence[str] = (), outputs: Sequence[str] = ()) -> LinearModel:
        """Return the model of some inputs and outputs, all of them if none are named.

        Raises
        ------
        UserError
            If there is no such input or output.
        """
        m = self.matrices
        ends = (inputs or self.inputs, outputs or self.outputs)
        columns = [_index(name, self.inputs, "input") for name in ends[0]]
        rows = [_index(name, self.outputs, "output") for name in ends[1]]
        return replace(
            self,
            matrices=replace(m, B=m.B[:, columns], C=m.C[rows], D=m.D[np.ix_(rows, columns)]),
            inputs=tuple(ends[0]),
            outputs=tuple(ends[1]),
            further=tuple(one.between(*ends) for one in self.further),
            variations=tuple(one.between(*ends) for one in self.variations),
        )

    def response(self, frequencies: Array, input: str = "", output: str = "") -> Array:
        """Return the frequency response from one input to one output.

        For a sampled model it is the response of samples to a sampled sine.

        Parameters
        ----------
        frequencies : ndarray, shape (n,)
            Frequencies, Hz.
        input, output : str
            The first ones if empty.

        Returns
        -------
        ndarray of complex, shape (n,)
            In the unit of the output per unit of the input.
        """
        s = 2j * pi * np.asarray(frequencies, dtype=float)
        argument = np.exp(s * self.period) if self.period else s
        return np.asarray(self.part(input, output)(argument), dtype=complex)

    def poles(self) -> Array:
        """Return the poles, shape (n,), in 1/s, or in the z-plane for a sampled model."""
        return np.asarray(self.state_space.poles())

    def zeros(self, input: str = "", output: str = "") -> Array:
        """Return the zeros from one input to one output, in the same plane as `poles`."""
        return np.asarray(self.part(input, output).zeros())

    def margins(self, input: str = "", output: str = "") -> LoopMargins:
        """Return the stability margins for negative feedback from an output to an input.

        Margins of a sampled loop are computed in the w-plane, ``w = 2/T (z - 1)/(z + 1)``, and
        their frequencies are converted back.
        """
        part = self.part(input, output)
        plane = w_plane(part) if self.period else part
        gain, phase, phase_crossover, crossover = self._margins_in_plane(plane)
        at_nyquist = float(plane.D[0, 0]) if self.period else 0.0
        if at_nyquist < 0.0 and abs(np.log(-at_nyquist)) < abs(np.log(gain)):
            # half the sampling rate, infinite in the w-plane, where python-control does not look
            gain, phase_crossover = -1.0 / at_nyquist, inf
        return LoopMargins(phase, self._hertz(crossover), gain, self._hertz(phase_crossover))

    def sensitivities(self, frequencies: Array) -> Array:
        """Return sensitivity and complementary sensitivity, with negative feedback.

        Parameters
        ----------
        frequencies : ndarray, shape (n,)
            Hz.

        Returns
        -------
        ndarray of complex, shape (2, n)
            ``1 / (1 + L)`` and ``L / (1 + L)``.
        """
        response = self.response(frequencies)
        return np.array([np.ones_like(response), response]) / (1.0 + response)

    def peaks(self) -> list[float]:
        """Return the largest absolute values of `sensitivities`."""
        sizes = np.abs(self.sensitivities(self.frequencies(_POINTS)))
        return [float(largest) for largest in sizes.max(axis=1)]

    def closed_poles(self) -> Array:
        """Return the poles with negative feedback, in the same plane as `poles`."""
        import control

        return np.asarray(control.feedback(self.part(), 1).poles())

    @property
    def band_words(self) -> str:
        """Phase margins of the variations of a loop in words."""
        phases = [one.margins().phase for one in self.variations]
        return (
            f"over {len(phases)} values of parameters: phase margin {min(phases):.1f} to"
            f" {max(phases):.1f}°"
        )

    def at_rest(self, name: str) -> float:
        """Return the value of a signal at the operating point; 0 of a model in deviations."""
        return self.point.values.get(name, 0.0)

    def _margins_in_plane(self, plane: control.TransferFunction) -> tuple[float, ...]:
        """Return gain and phase margin, phase and gain crossover of a loop, as python-control does.

        Where roots of polynomials give no crossover with gain one, the response is interpolated.
        """
        import control

        margins = control.margin(plane)
        crossover = margins[-1]
        # roots may be inaccurate or missing
        if not (np.isfinite(crossover) and abs(abs(plane(1j * crossover)) - 1.0) <= _UNITY):
            omega = 2.0 * pi * self.frequencies(_POINTS)
            if self.period:
                omega = 2.0 / self.period * np.tan(0.5 * omega * self.period)
            margins = control.margin(control.frd(plane(1j * omega), omega, smooth=True))
        return tuple(map(float, margins))

    def _hertz(self, omega: float) -> float:
        """Return the frequency, Hz, of an angular frequency in the w-plane or the s-plane."""
        if not self.period:
            return omega / (2.0 * pi)
        return float(np.arctan(0.5 * omega * self.period)) / (pi * self.period)

    def frequencies(self, count: int = 400) -> Array:
        """Return frequencies, shape (count,), Hz, at equal ratios, that span all poles and zeros.

        Those of a sampled model end just below half its sampling rate.
        """
        poles = self._angular_frequencies(self.poles())
        zeros = [
            self._angular_frequencies(self.zeros(i, o)) for i in self.inputs for o in self.outputs
        ]
        roots = np.concatenate([poles, *zeros])
        # zeros at infinity are computed as very fast ones
        limit = FAR * poles.max() if poles.size else np.inf
        hertz = roots[roots <= limit] / (2.0 * pi)
        nyquist = 0.5 / self.period if self.period else np.inf
        visible = hertz[(hertz > _FLOOR * hertz.max(initial=0.0)) & (hertz < nyquist)]
        if not visible.size:
            visible = np.ones(1)
        top = 0.999 * nyquist if self.period else visible.max() * 10.0**_DECADES
        bottom = min(visible.min() * 10.0**-_DECADES, 1e-3 * top)
        return np.geomspace(bottom, top, count)

    def _angular_frequencies(self, roots: Array) -> Array:
        """Return the angular frequencies of finite poles or zeros, rad/s."""
        finite = np.asarray(roots)[np.isfinite(roots)]
        if not self.period:
            return np.abs(finite)
        return np.abs(np.log(finite[np.abs(finite) > np.finfo(float).tiny])) / self.period

    # --- forms

    def overview(self) -> Iterator[RenderableType]:
        """Yield operating point, margins of a loop, signals with units, and poles."""
        time = f"sampled every {self.period:g} s" if self.period else "continuous"
        yield f"{self.name} {self.point.words}, {time}, by {self.method}"
        if self.loop:
            yield f"loop transfer function, cut at {self.loop}: {margin_words(self.margins())}"
        for one in self.beside if self.loop else ():
            yield f"also {one.words}: {margin_words(one.margins())}"
        if self.loop and len(self.variations) > FAMILY:
            yield self.band_words
        points = [self.point, *(one.point for one in self.beside)]
        heads = [one.words for one in (self, *self.beside)] if self.beside else ["operating point"]
        table = plain_table(None, "signal", "is", *heads, "unit", right=heads)
        for kind, names in self._names.items():
            for name in names:
                values = [point.values.get(name) for point in points]
                texts = ["" if value is None else f"{value:.6g}" for value in values]
                table.add_row(name, kind.removesuffix("s"), *texts, self.units.get(name, ""))
        yield table
        if self.matrices.states:
            yield poles_table(self.matrices.A, self.period)
        yield from self.notes
        pairs = [(one.words, note) for one in self.beside for note in one.notes]
        beside = [f"{words}: {note}" for words, note in pairs if note not in self.notes]
        yield from beside[:_NOTES_BESIDE]
        if len(beside) > _NOTES_BESIDE:
            yield f"{len(beside) - _NOTES_BESIDE} more notes on these are in the JSON"

    def __repr__(self) -> str:
        ends = f"{', '.join(self.inputs)} -> {', '.join(self.outputs)}"
        return one_line(f"LinearModel {self.name} {self.point.words}: {ends}")

    def to_dict(self) -> dict[str, Any]:
        """Return a dictionary for JSON, with poles as pairs of real and imaginary part."""
        point = self.point
        result = {
            "model": self.name,
            "method": self.method,
            "period": self.period,
            "loop": self.loop or None,
            **{
                kind: [{"name": name, "unit": self.units.get(name, "")} for name in names]
                for kind, names in self._names.items()
            },
            **{name: matrix.tolist() for name, matrix in self.matrices.by_name.items()},
            "operating_point": {
                "time": point.time,
                "trimmed": point.trimmed,
                "values": point.values,
                "drift": point.drift,
                "undetermined": list(point.undetermined),
            },
            **self.summary(),
        }
        if self.further:
            result["further"] = [one.to_dict() for one in self.further]
        if self.variations:
            result["variations"] = [{"case": one.case, **one.summary()} for one in self.variations]
        return result

    def summary(self) -> dict[str, Any]:
        """Return poles, notes and margins of a loop, for JSON."""
        margins = {"margins": self.margins()._asdict()} if self.loop else {}
        poles = [[float(p.real), float(p.imag)] for p in np.atleast_1d(self.poles()) + 0j]
        return {"poles": poles, "notes": list(self.notes), **margins}

    def to_mat(self, path: str | Path) -> Path:
        """Write A, B, C, D, the sample period Ts, names and units to a MATLAB file.

        Parameters
        ----------
        path : str or Path
            Its name must end in ``.mat``.

        Returns
        -------
        Path

        Raises
        ------
        UserError
            If the file cannot be written, or its name has another ending.
        """
        import io

        from scipy.io import savemat

        if Path(path).suffix.lower() != _MATLAB:
            raise UserError(f"cannot write {path}: its name must end in {_MATLAB}")

        cells = {kind: np.array(names, dtype=object) for kind, names in self._names.items()}
        units = {
            f"{kind}_units": np.array([self.units.get(n, "") for n in names], dtype=object)
            for kind, names in cells.items()
        }
        content: Any = io.BytesIO()
        savemat(content, {**self.matrices.by_name, "Ts": self.period, **cells, **units})
        files.write(Path(path), content.getvalue())
        return Path(path)


def linear_model_of(system: Any) -> LinearModel:
    """Return a system of python-control as a linear model, in deviations.

    Parameters
    ----------
    system : control.StateSpace, control.TransferFunction

    Raises
    ------
    UserError
        If its sample period is not known, or it has no state space.
    """
    with optional():
        import control

    if system.dt is True:
        raise UserError("a sampled system without a sample period: give it a dt in s")
    try:
        states = control.ss(system)
    except (ValueError, TypeError) as error:
        # more zeros than poles, or a table of a frequency response
        raise UserError(f"a system of python-control without a state space: {error}") from error
    matrices = matrices_of(states, tuple(map(str, states.state_labels)))
    point = OperatingPoint(0.0, {}, {}, {}, {})
    inputs = tuple(map(str, states.input_labels))
    outputs = tuple(map(str, states.output_labels))
    return LinearModel("plant", matrices, inputs, outputs, {}, point, "python-control")


def matrices_of(system: control.StateSpace, states: tuple[str, ...]) -> Matrices:
    """Return the matrices of a system of python-control, with names of its states."""
    return Matrices(system.A, system.B, system.C, system.D, float(system.dt or 0.0), states)


def w_plane(sampled: control.StateSpace) -> control.StateSpace:
    """Return a sampled system as a continuous one in the w-plane, ``w = 2/T (z - 1)/(z + 1)``.

    Raises
    ------
    UserError
        If it is not sampled, or has a pole at z = -1, which the w-plane has at infinity.
    """
    with optional():
        import control

    if not sampled.dt:
        raise UserError("a continuous system has no w-plane; only a sampled one has")
    n = sampled.nstates
    shifted = np.eye(n) + sampled.A
    if n and np.linalg.cond(shifted) > 1.0 / np.finfo(float).eps:
        raise UserError("a pole at z = -1, half the sampling rate, has no place in the w-plane")
    inverse = np.linalg.inv(shifted)
    scale = 2.0 / sampled.dt
    return control.StateSpace(
        scale * inverse @ (sampled.A - np.eye(n)),
        2.0 * scale * inverse @ inverse @ sampled.B,
        sampled.C,
        sampled.D - sampled.C @ inverse @ sampled.B,
        remove_useless_states=False,
    )


def _index(name: str, names: Sequence[str], kind: str) -> int:
    """Return the index of a name, 0 if it is empty; raise if it is unknown."""
    places = {known: place for place, known in enumerate(names)}
    return find(name, places, f"no {kind}") if name else 0


def margin_words(margins: LoopMargins) -> str:
    """Return phase and gain margin in words."""
    phase = (
        f"phase margin {margins.phase:.1f}° at {margins.crossover:.4g} Hz"
        if np.isfinite(margins.crossover)
        else "no crossover"
    )
    gain = (
        f"gain margin {margins.gain:.4g} at {margins.phase_crossover:.4g} Hz"
        if np.isfinite(margins.gain)
        else "gain margin without limit"
    )
    return f"{phase}, {gain}"
