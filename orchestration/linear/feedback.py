"""A sampled controller around a linear plant: its loop, sensitivities and responses to steps.

The plant is sampled with all delays; the controller is a component, whose own laws, limits
included, are simulated. The command of a sample is held from that sample on.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from fmus.kit import Component, UserError
from fmus.kit.arrays import Array
from fmus.kit.interrupt import uninterrupted
from fmus.kit.registry import DesignedController
from fmus.kit.symbolic import trace
from orchestration.fmu import Model, Value
from orchestration.linear.discretisation import Matrices
from orchestration.linear.model import LinearModel, LoopMargins, margin_words, matrices_of
from orchestration.linear.operating_point import OperatingPoint, start_point
from orchestration.linear.subject import subject_of
from orchestration.reporting import Displayable, one_line, plain_table
from orchestration.system import System

if TYPE_CHECKING:
    from rich.console import RenderableType

_SAME = 1e-9  # largest relative difference of two times due to rounding
_MOST_DELAYED = 50  # samples of dead time, beyond which longer sample periods lose nothing
_FEWEST = 200  # samples of a step response
_MOST = 20_000
_CYCLES = 8.0  # duration of a step response, in periods of the crossover frequency
_SETTLED = 6.0  # the same, in time constants of the slowest pole of the closed loop
_MARGINAL = 1.0 + 1e-9  # pole that still counts as stable, of an integral that drifts


def sampled_plant(plant: LinearModel, period: float, delay: float) -> LinearModel:
    """Return a plant as a controller sees it: command held over a period, all delays in it.

    Parameters
    ----------
    plant : LinearModel
        With one input, continuous or sampled.
    period : float
        Sample period of the controller, s; of a sampled plant a multiple of its own.
    delay : float
        Time from a command to its effect, or from a value to its measurement, s.

    Returns
    -------
    LinearModel
        The states are those of the plant, and the latest commands if they act later or at once.

    Raises
    ------
    UserError
        If the delay is too many samples, or a sampled plant cannot be sampled so.
    """
    if not 0.0 <= delay <= _MOST_DELAYED * period:
        raise UserError(
            f"a delay of {delay:g} s: from 0 to {_MOST_DELAYED} sample periods, {period:g} s each,"
            " are allowed; a longer one needs a longer sample period"
        )
    m = plant.matrices
    n = len(m.states)
    whole = int(delay / period + _SAME)
    rest = delay - whole * period
    if rest <= _SAME * period:
        rest = 0.0
    late = _flow(plant, rest, "delay")
    early = _flow(plant, period - rest, "sample period")
    # an earlier command acts at first, or on the output at once: a sample sees none of its own
    count = whole + int(rest > 0.0 or m.D.any())
    # next state and output, by the state and by commands, the latest first
    step = np.zeros((n + count, n + count + 2))
    step[:n, :n] = early[:n, :n] @ late[:n, :n]
    step[:n, n + whole] = early[:n, n]
    step[:n, n + whole + 1] = early[:n, :n] @ late[:n, n]
    step[n:, n:-2] = np.eye(count)
    output = np.zeros((len(plant.outputs), n + count + 2))
    output[:, :n] = m.C
    output[:, n + whole + 1] = m.D[:, 0]
    states = [*range(n), *range(n + 1, n + count + 1)]
    names = (*m.states, *(f"{plant.inputs[0]} {k} samples ago" for k in range(1, count + 1)))
    matrices = Matrices(
        step[:, states], step[:, [n]], output[:, states], np.zeros(m.D.shape), period, names
    )
    varied = tuple(sampled_plant(one, period, delay) for one in plant.variations)
    return replace(plant, matrices=matrices, variations=varied, further=())


def _flow(plant: LinearModel, duration: float, name: str) -> Array:
    """Return the transition matrix of states and input, which is constant, over a duration, s.

    Raises
    ------
    UserError
        If the duration is not a whole number of periods of a sampled plant.
    """
    from scipy.linalg import expm

    m = plant.matrices
    n = len(m.states)
    joined = np.zeros((n + 1, n + 1))
    joined[:n] = np.hstack([m.A, m.B])
    if not plant.period:
        return np.asarray(expm(joined * duration))
    joined[n, n] = 1.0
    count = round(duration / plant.period)
    if abs(count * plant.period - duration) > _SAME * plant.period:
        raise UserError(
            f"{plant.name} is sampled every {plant.period:.9g} s: the {name} of the controller"
            f" must be a multiple of that"
        )
    return np.linalg.matrix_power(joined, count)


def _loop(plant: LinearModel, law: LinearModel) -> LinearModel:
    """Return the loop transfer function of a plant and the law of its controller."""
    cut = plant.inputs[0]
    return replace(
        plant,
        matrices=matrices_of(-law.state_space * plant.state_space, (*plant.states, *law.states)),
        inputs=(f"cut({cut})",),
        outputs=(cut,),
        units=plant.units | {f"cut({cut})": plant.units.get(cut, "")},
        loop=cut,
        variations=tuple(_loop(one, law) for one in plant.variations),
    )


def _is_stable(loop: LinearModel) -> bool:
    """Return whether a sampled loop, closed, is stable within the limits of the command."""
    return bool(np.abs(loop.closed_poles()).max() < _MARGINAL)


@dataclass(frozen=True)
class StepResponse:
    """Response of a closed loop to a step, in SI units.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Seconds.
    measured, command : ndarray, shape (n,)
        Measured value, and the command from each sample on, within its limits.
    """

    time: Array
    measured: Array
    command: Array


@dataclass(frozen=True)
class ControllerDesign(Displayable):
    """A controller around a plant.

    Attributes
    ----------
    designed : DesignedController
    plant : LinearModel
        Sampled, with its delays; its variations make the band.
    limits : tuple of float
        Lowest and highest command.
    model : Model, System, str or None
        The plant as it runs, or the name or file of its system; None for a linear model alone.
    settings : Mapping of str to float or str
        Values of parameters of a plant without equations, by ``member.parameter``.
    """

    designed: DesignedController
    plant: LinearModel
    limits: tuple[float, float]
    model: Model | System | str | None = None
    settings: Mapping[str, Value] = field(default_factory=dict)

    @cached_property
    def controller(self) -> type[Component]:
        """Class of the controller, whose signals `designed` names."""
        return self.designed.component

    @cached_property
    def system(self) -> System:
        """The loop as a system that runs, from the operating point on; see `closed_system`."""
        from orchestration.linear.closed_system import closed_system

        return closed_system(self)

    def write(self, folder: str | Path) -> list[Path]:
        """Write controller and loop into a folder; see `write_files`."""
        from orchestration.linear.closed_system import write_files

        return write_files(self, Path(folder))

    def __getstate__(self) -> dict[str, Any]:
        # what is derived, such as a class, is derived again
        return {one.name: getattr(self, one.name) for one in fields(self)}

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters of the controller, SI."""
        return {p.name: float(p.start) for p in self.controller.layout.parameters if not p.starts}

    @cached_property
    def point(self) -> OperatingPoint:
        """Operating point of the controller."""
        signals = {**self.designed.signals, self.designed.reference: self.plant.outputs[0]}
        inputs = {port: self.plant.at_rest(signal) for port, signal in signals.items()}
        return start_point(trace(self.controller), inputs)

    @property
    def _within_limits(self) -> OperatingPoint:
        """The operating point without limits of the command, which may be at one of them."""
        return self.point.updated(dict(zip(self.designed.limits, (-np.inf, np.inf), strict=False)))

    @cached_property
    def law(self) -> LinearModel:
        """Linear law of the controller, from what it measures to the command it makes of it.

        Its own output is that before a sample; this one is that from the sample on. Where the
        command is at a limit, it is the law within the limits.

        Raises
        ------
        UserError
            If the command does not wait for a sample.
        """
        subject = subject_of(self.controller)
        law = subject.linearise(self._within_limits, self._measured, [self.designed.command])
        m = law.matrices
        if not m.period or m.D.any():
            raise UserError(f"{law.name}: its command does not wait for a sample")
        matrices = replace(m, C=m.C @ m.A, D=m.C @ m.B)
        return replace(law, matrices=matrices, point=self.point)

    @property
    def _measured(self) -> list[str]:
        """Inputs of the controller that outputs of the plant feed, in the order of these."""
        signals = self.designed.signals
        return [port for port in signals if signals[port] in self.plant.outputs]

    @cached_property
    def loop(self) -> LinearModel:
        """Loop transfer function, with those of the band."""
        return _loop(self.plant, self.law)

    def margins(self) -> LoopMargins:
        """Return the stability margins."""
        return self.loop.margins()

    def peaks(self) -> list[float]:
        """Return the largest sensitivity and complementary sensitivity."""
        return self.loop.peaks()

    # --- responses

    @property
    def _headroom(self) -> float:
        """Command from the operating point to the farther limit, with its sign; 1 without one."""
        at_rest = self.plant.at_rest(self.plant.inputs[0])
        farther = max(np.array(self.limits[::-1]) - at_rest, key=abs)
        return float(farther) if np.isfinite(farther) else 1.0

    @property
    def step_size(self) -> float:
        """Step of the reference of the picture, whose command takes about the headroom."""
        crossover = self.margins().crossover
        frequency = crossover if np.isfinite(crossover) else self.loop.frequencies()[0]
        gain = abs(self.plant.response(np.array([frequency]))[0])
        return float(-gain * self._headroom * np.sign(self.law.matrices.D[0, 0]))

    @property
    def load_size(self) -> float:
        """Step of the load of the picture, added to the command, which half the headroom meets."""
        return -0.5 * self._headroom

    @uninterrupted()
    def step(
        self, reference: float = 0.0, load: float = 0.0, plant: LinearModel | None = None
    ) -> StepResponse:
        """Simulate the loop after steps from the operating point, with the limits.

        Parameters
        ----------
        reference : float
            Step of the reference.
        load : float
            Step that is added to the command behind the controller.
        plant : LinearModel, optional
            One of the variations of `plant`.

        Returns
        -------
        StepResponse
        """
        m = (plant or self.plant).matrices
        x, held = ca.MX.sym("x", len(m.states)), ca.MX.sym("held", len(self.point.discretes))
        rest = ca.DM([self.point.inputs[port] for port in self._measured])
        measured = rest + ca.DM(m.C) @ x
        after, command = self._sample(held, ca.vertcat(rest[0] + reference, measured))
        driven = command - self.plant.at_rest(self.plant.inputs[0]) + load
        sample = ca.Function(
            "sample",
            [ca.vertcat(x, held)],
            [
                ca.vertcat(ca.DM(m.A) @ x + ca.DM(m.B) * driven, after),
                ca.vertcat(measured[0], command),
            ],
        )
        start = [*np.zeros(len(m.states)), *self.point.discretes.values()]
        _, outputs = sample.mapaccum("loop", len(self.time))(start)
        return StepResponse(self.time, *outputs.full())

    @cached_property
    def time(self) -> Array:
        """Instants of the step responses, s: until the loop has settled."""
        period = self.plant.period
        crossover = self.margins().crossover
        cycles = _CYCLES / (crossover * period) if np.isfinite(crossover) else 0.0
        slowest = np.abs(self.loop.closed_poles()).max()
        settled = _SETTLED / -np.log(slowest) if 0.0 < slowest < 1.0 else 0.0
        count = np.clip(max(cycles, min(settled, 10.0 * cycles)), _FEWEST, _MOST)
        return np.asarray(period * np.arange(int(count) + 1), dtype=float)

    @cached_property
    @uninterrupted()
    def _sample(self) -> ca.Function:
        """Function from discrete states and inputs to states and command of a sample."""
        graph = trace(self.controller)
        held = ca.MX.sym("held", len(self.point.discretes))
        ports = (self.designed.reference, *self._measured)
        driven = ca.MX.sym("driven", len(ports))
        signals = self.point.inputs | dict(zip(ports, ca.vertsplit(driven), strict=True))
        inputs = ca.vertcat(*(signals[v.name] for v in graph.layout.inputs))
        known: list[Any] = [0.0, self.point.arguments(graph)[1], inputs, ca.MX(0, 1)]
        laws = ca.Function("laws", graph.arguments, [graph.updates[0], graph.outputs])
        after, _ = laws(*known, held)
        _, outputs = laws(*known, after)
        command = outputs[[v.name for v in graph.layout.outputs].index(self.designed.command)]
        return ca.Function("controller", [held, driven], [after, command])

    # --- forms

    def overview(self) -> Iterator[RenderableType]:
        """Yield margins, sensitivity peaks, their band, and the parameters."""
        path = f"{self.plant.inputs[0]} to {self.plant.outputs[0]}"
        yield f"{self.controller.name} around {self.plant.name}, {path}, {self.plant.point.words}"
        yield f"{margin_words(self.margins())}; sensitivity at most {self.peaks()[0]:.3g}"
        if not _is_stable(self.loop):
            yield "closed, this loop is unstable"
        if self.loop.variations:
            peak = max(one.peaks()[0] for one in self.loop.variations)
            unstable = sum(not _is_stable(one) for one in self.loop.variations)
            remark = f"; {unstable} of these loops are unstable" if unstable else ""
            yield f"{self.loop.band_words}, sensitivity at most {peak:.3g}{remark}"
        if np.isfinite(self.limits).any():
            low, high = self.limits
            unit = self.plant.units.get(self.plant.inputs[0], "")
            yield f"command within {low:g} to {high:g} {unit}".rstrip()
        table = plain_table(None, "parameter", "value", "unit", right=["value"])
        units = {p.name: p.unit for p in self.controller.layout.parameters}
        for name, value in self.parameters.items():
            table.add_row(name, f"{value:.6g}", units[name])
        yield table
        yield from self.plant.notes

    def __repr__(self) -> str:
        return one_line(f"ControllerDesign of {self.plant.name}: {margin_words(self.margins())}")

    def to_dict(self) -> dict[str, Any]:
        """Return a dictionary for JSON."""
        sensitivity, complementary = self.peaks()
        loop = replace(self.loop, variations=())
        return {
            "controller": self.controller.name,
            "source": self.designed.source,
            "parameters": self.parameters,
            "stable": _is_stable(loop),
            "limits": [one if np.isfinite(one) else None for one in self.limits],
            "peaks": {"sensitivity": sensitivity, "complementary": complementary},
            "band": [
                {
                    "margins": one.margins()._asdict(),
                    "sensitivity": one.peaks()[0],
                    "stable": _is_stable(one),
                }
                for one in self.loop.variations
            ],
            "loop": loop.to_dict(),
        }
