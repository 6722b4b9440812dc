"""Any FMU as a model that is fitted: its course over a record, and derivatives by differences.

FMI 2.0 knows directional derivatives at a communication point, and those by parameters in initialization only; of what
a parameter does to the steps from there on they say nothing. So every parameter is moved a little to either side. How
little is read off the FMU: the error of a difference falls with the square of the step and the noise of the FMU's
solver grows with its reciprocal, so that of a ladder of steps those are best of which two neighbours agree best.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from itertools import pairwise
from math import inf
from pathlib import Path
from time import monotonic
from types import SimpleNamespace, TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.kit.declare import ParameterDeclaration
from fmus.kit.errors import UserError
from fmus.kit.record.compiled import Trajectory
from orchestration.fmu.archive import read_description
from orchestration.fmu.isolation.limits import Limits, limits_of
from orchestration.fmu.isolation.pool import Pool
from orchestration.fmu.isolation.process import Ended
from orchestration.fmu.model import Model
from orchestration.fmu.repeated import RepeatedFmu
from orchestration.fmu.signal import Signal, Value

Array = NDArray[np.float64]
_LADDER = 10.0 ** -np.arange(1.0, 6.5, 0.5)  # steps relative to the size of a parameter
_PATIENCE, _STIFFER = (
    2.0,
    30.0,
)  # s that a run may take in any case, and how many times the first one's time
_MOVED = 2.0  # times as large or small: where a step is chosen anew
_repeated: RepeatedFmu | None = None  # of a worker


class FmuWithDifferences:
    """An FMU that runs over records; a context manager that closes it.

    Parameters
    ----------
    model : Model
    names : sequence of str
        Parameters with respect to which derivatives are wanted.
    outputs : sequence of str
        That are wanted.
    settings : Mapping of str to float or str
        Other parameters, in the FMU's units.
    workers : int
        Processes that run it side by side; with one it runs here.

    Attributes
    ----------
    layout : SimpleNamespace
        With ``parameters``, as a component declares them.
    delays : dict
        Empty.
    runs : int
        Simulations made.
    """

    def __init__(
        self,
        model: Model,
        names: Sequence[str],
        outputs: Sequence[str],
        settings: Mapping[str, Value] | None = None,
        workers: int = 1,
    ):
        sizes = _nominal(model.path)
        numbers = [s for s in model.parameters.values() if s.type != "string"]
        self.layout = SimpleNamespace(
            parameters=[_declared(s, sizes.get(s.name, 0.0)) for s in numbers]
        )
        self.delays: dict[str, str] = {}
        self.runs = 0
        self._declared = {p.name: p for p in self.layout.parameters}
        self._path, self._names, self._outputs = model.path, list(names), list(outputs)
        self._settings, self._workers, self._limits = (
            dict(settings or {}),
            workers,
            limits_of(model.foreign),
        )
        self._steps: dict[str, tuple[float, float]] = {}
        self._open, self._is_open = ExitStack(), False
        self._longest = np.inf  # s that a run may take

    @contextmanager
    def opened(self) -> Iterator[None]:
        """Have it open, again if it was closed."""
        with nullcontext() if self._is_open else self:
            yield

    def __enter__(self) -> FmuWithDifferences:
        if self._limits is None:
            self._fmu = self._open.enter_context(RepeatedFmu(self._path))
        if self._limits is not None or self._workers > 1:
            pool = Pool(self._limits or Limits(inf, inf), self._workers, _begin, self._path)
            self._pool = self._open.enter_context(pool)
        self._is_open = True
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._is_open = False
        self._open.__exit__(kind, error, trace)

    def run(
        self,
        time: Array,
        inputs: Mapping[str, Array],
        parameters: Mapping[str, float],
        effort: float = 0.0,
    ) -> Trajectory:
        """Simulate, as `CompiledModel.run`; the inputs are held from sample to sample.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Seconds.
        inputs : Mapping of str to ndarray, shape (n,)
            In the FMU's units, as is everything else.
        parameters : Mapping of str to float
            Those that were not named at first stay as they are.
        effort : float
            Of no use here: how an FMU integrates is its own affair.

        Returns
        -------
        Trajectory
            Of the wanted outputs.

        Raises
        ------
        UserError
            If the FMU fails there, or on both sides.
        """
        at = {name: float(parameters[name]) for name in self._names}
        stimulus, begin = (time, dict(inputs)), monotonic()
        here = self._all(stimulus, [at])[0]
        if (
            self._longest == np.inf
        ):  # where a fit begins its model is not stiff, and elsewhere it shall not be much more
            self._longest = max(_PATIENCE, _STIFFER * (monotonic() - begin))
        if isinstance(here, UserError):
            raise here
        for name in self._names:
            if not self._still_holds(name, at[name]):
                self._steps[name] = (
                    self._size(name, at[name]),
                    self._step(stimulus, at, here, name),
                )
        slopes = self._slopes(
            stimulus, at, here, [(name, self._steps[name][1]) for name in self._names]
        )
        for name, slope in zip(self._names, slopes, strict=True):
            if not np.isfinite(slope).all():
                raise UserError(f"{self._path.name}: fails on either side of {name} = {at[name]:g}")
        return Trajectory(
            {o: here[:, k] for k, o in enumerate(self._outputs)},
            {
                o: np.array([s[:, k] for s in slopes]).reshape(len(slopes), len(time)).T
                for k, o in enumerate(self._outputs)
            },
        )

    def _size(self, name: str, value: float) -> float:
        return abs(value) or self._declared[name].nominal

    def _still_holds(self, name: str, value: float) -> bool:
        if name not in self._steps:
            return False
        before = self._steps[name][0]
        return 1.0 / _MOVED <= self._size(name, value) / before <= _MOVED

    def _step(self, stimulus: Any, at: Mapping[str, float], here: Array, name: str) -> float:
        """The relative step at which a difference changes least if it is made smaller or larger."""
        slopes = self._slopes(stimulus, at, here, [(name, step) for step in _LADDER])
        scale = np.where(here.std(axis=0) > 0.0, here.std(axis=0), 1.0)
        apart = np.array(
            [float(np.linalg.norm((one - two) / scale)) for one, two in pairwise(slopes)]
        )
        tells = np.isfinite(apart) & [bool(slope.any()) for slope in slopes[1:]]
        return float(_LADDER[1 + int(np.argmin(np.where(tells, apart, np.inf)))])

    def _slopes(
        self,
        stimulus: Any,
        at: Mapping[str, float],
        here: Array,
        steps: Sequence[tuple[str, float]],
    ) -> list[Array]:
        """Derivatives (n, m) by parameters, each by its step, from one side where the FMU fails on the other."""
        points = [self._sides(name, at[name], step) for name, step in steps]
        found = iter(
            self._all(
                stimulus,
                [
                    {**at, name: x}
                    for (name, _), pair in zip(steps, points, strict=True)
                    for x in pair
                ],
            )
        )
        slopes = []
        for (name, _), pair in zip(steps, points, strict=True):
            (low, below), (high, above) = (
                (at[name], here) if isinstance(y, UserError) else (x, y)
                for x, y in zip(pair, found, strict=False)
            )
            slopes.append(
                (above - below) / (high - low) if high > low else np.full_like(here, np.nan)
            )
        return slopes

    def _sides(self, name: str, value: float, step: float) -> tuple[float, float]:
        """Values on either side, inside the range of the parameter."""
        declared, width = self._declared[name], step * self._size(name, value)
        return max(value - width, declared.min), min(value + width, declared.max)

    def _all(self, stimulus: Any, wanted: Sequence[Mapping[str, float]]) -> list[Array | UserError]:
        """Run the FMU with several values; what it refuses is in its place."""
        self.runs += len(wanted)
        jobs = [
            (*stimulus, self._settings | dict(values), self._outputs, self._longest)
            for values in wanted
        ]
        if self._limits is None and (self._workers == 1 or len(jobs) == 1):
            return [_one(self._fmu, *job) for job in jobs]
        found = [self._pool.submit(_work, job) for job in jobs]
        try:
            return [future.result() for future in found]
        except Ended as end:
            where = end.state.words(stimulus[0], self._path.name)
            raise UserError(f"{where}: {end.reason}") from end


def _begin(path: Path) -> None:
    global _repeated
    _repeated = RepeatedFmu(path)
    _repeated.__enter__()


def _work(job: Any) -> Array | UserError:
    assert _repeated is not None
    return _one(_repeated, *job)


def _one(fmu: RepeatedFmu, *job: Any) -> Array | UserError:
    try:
        return fmu.run(*job)
    except UserError as error:
        return error


def _nominal(path: Path) -> dict[str, float]:
    """Typical sizes that an FMU tells of its variables."""
    told = ((v.name, getattr(v, "nominal", None)) for v in read_description(path).modelVariables)
    return {name: abs(float(size)) for name, size in told if size}


def _declared(signal: Signal, nominal: float) -> ParameterDeclaration:
    declared = ParameterDeclaration(
        unit=signal.unit,
        doc=signal.doc,
        min=signal.min,
        max=signal.max,
        display=signal.display,
        type=signal.type,
        nominal=nominal or abs(signal.start) or 1.0,
        start=signal.start,
    )
    declared.name = signal.name
    return declared
