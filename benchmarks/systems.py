"""Systems of FMUs: masters side by side, the life of a film, and real time."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import fmpy
import numpy as np

from demonstrations.thesis import ageing
from fmus import component
from fmus.kit.arrays import Array
from fmus.kit.build import host_platform
from fmus.kit.record.compiled import CompiledModel
from orchestration import master
from orchestration.master.reference.fused import fuse
from orchestration.system import ssp
from orchestration.system.model import Member, Port, System, connect
from tests.support import hosts

from .tables import Cell, Table
from .timing import Duration, Times, comparison, in_a_process, take_turns, timed

OURS = "ours, Jacobi"
IN_TURN = "ours, Gauss–Seidel"
ECOS = "Ecos"
COSIM = "libcosim"
FUSED = "ours, fused"
PACKED = "ours, packed into one FMU"
FMPY = "fmpy.ssp"
AGREEMENT = 1e-9
_STEP = 1e-3  # s
_BENCH = "voice_coil_dma"
_ACTUATOR = "ppy_actuator_length_driven"


def masters(quick: bool) -> Iterator[str | Table]:
    """Time all masters on one system, and ours on systems of growing size."""
    # fewer steps than that are shorter than the scatter of what fmpy needs to open a system
    steps, rounds = (2000, 2) if quick else (5000, 15)
    (alone, recorded), _ = in_a_process(_compare, steps, rounds)
    for title, times in {"Steps alone:": alone, "Every output recorded:": recorded}.items():
        yield title
        yield comparison(times, dict.fromkeys(times.seconds, ECOS))
    sizes, steps, rounds = ((2, 4), 20, 1) if quick else ((2, 4, 8, 16, 32, 64), 1000, 5)
    grown = {f"{n} actuators": _ours(bundle(n), steps, method="jacobi") for n in sizes}
    yield "Ours, with more and more actuators, every output recorded:"
    yield comparison(take_turns(grown, rounds), dict.fromkeys(grown, next(iter(grown))))


def _compare(steps: int, rounds: int) -> list[Times]:
    """Time the masters in turns, stepping alone and recording every output."""
    system = bundle(1)
    positions = dict[str, float]()
    as_others = {"method": "jacobi", "feedthrough": False, "record": ["bench.position"]}
    with tempfile.TemporaryDirectory(prefix="benchmark_") as folder:
        path = Path(folder, "bundle.ssp")
        ssp.write(system, path)
        outputs = {
            (member.name, variable.name): _reference(member, variable.name)
            for member in system.members
            if member.cls is not None
            for variable in member.cls.layout.measurable
        }
        alone: dict[str, Duration] = {
            OURS: _ours(system, steps, positions, **as_others),
            ECOS: partial(_ecos, path, steps, positions),
            COSIM: partial(_libcosim, path, steps, positions, outputs, False),
        }
        packed = _packed(system, Path(folder, "bundle.fmu"))
        recorded: dict[str, Duration] = {
            OURS: _ours(system, steps, method="jacobi"),
            IN_TURN: _ours(system, steps),
            PACKED: _ours(packed, steps),
            FMPY: partial(_fmpy, path, steps),
            ECOS: partial(_ecos, path, steps, {}, outputs),
            COSIM: partial(_libcosim, path, steps, {}, outputs, True),
            FUSED: timed(partial(CompiledModel(fuse(system)).run, _points(steps), {}), steps),
        }
        found = [take_turns(alone, rounds), take_turns(recorded, rounds)]
    check_agreement(positions)
    return found


def _fmpy(path: Path, steps: int) -> float:
    """Return the duration of a step by fmpy: that of many without that of one, which opens all."""
    from fmpy.ssp.simulation import simulate_ssp

    def seconds(count: int) -> float:
        stop = (count - 0.5) * _STEP
        return timed(partial(simulate_ssp, str(path), stop_time=stop, step_size=_STEP))()

    return (seconds(steps) - seconds(1)) / steps


def _packed(system: System, path: Path) -> System:
    """Return the system whose only member is another one, packed."""
    path.write_bytes(master.pack(system, [host_platform()]))
    return System("packed", (Member("packed", path),), ())


def check_agreement(positions: Mapping[str, float]) -> None:
    """Raise RuntimeError if masters come to other positions, as their times mean nothing then."""
    for name, position in positions.items():
        if abs(position - positions[OURS]) > AGREEMENT * abs(positions[OURS]):
            raise RuntimeError(
                f"{name}: position {position!r} after the last step, ours {positions[OURS]!r}"
            )


def _points(steps: int) -> Array:
    return _STEP * np.arange(steps + 1, dtype=np.float64)


def _ours(
    system: System, steps: int, positions: dict[str, float] | None = None, **options: Any
) -> Duration:
    """Return the duration of a step by our master, without opening and initialization."""

    def go() -> float:
        result = master.run(system, _points(steps), {}, **options)
        if positions is not None:
            positions[OURS] = float(result.signals["bench.position"][-1])
        return result.statistics.wall / steps

    return go


def _ecos(
    path: Path, steps: int, positions: dict[str, float], record: Iterable[tuple[str, str]] = ()
) -> float:
    hosts.preload_tbb()
    from ecospy import EcosSimulation  # type: ignore[import-untyped]

    simulation = EcosSimulation(ssp_path=str(path), step_size=_STEP)
    try:
        if record:
            names = list(map("::".join, record))
            simulation.add_csv_writer(str(path.with_suffix(".csv")), identifiers=names)
        simulation.init(0.0, "start")
        seconds = timed(partial(simulation.step, steps), steps)()
        positions[ECOS] = simulation.get_real("bench::position")
        simulation.terminate()
    finally:
        simulation.free()
    return seconds


def _libcosim(
    path: Path,
    steps: int,
    positions: dict[str, float],
    references: Mapping[tuple[str, str], int],
    record: bool,
) -> float:
    from libcosimpy.CosimEnums import CosimVariableType  # type: ignore[import-untyped]
    from libcosimpy.CosimExecution import CosimExecution  # type: ignore[import-untyped]
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level  # type: ignore[import-untyped]
    from libcosimpy.CosimObserver import CosimObserver  # type: ignore[import-untyped]

    log_output_level(CosimLogLevel.ERROR)
    execution = CosimExecution.from_ssp_file(str(path), round(_STEP * hosts.NANOSECONDS))
    index = {info.name.decode(): info.index for info in execution.slave_infos()}
    observer = CosimObserver.create_last_value()
    if record:
        observer = CosimObserver.create_time_series(buffer_size=steps)
        execution.add_observer(observer)
        for (member, _), reference in references.items():
            observer.start_time_series(index[member], reference, CosimVariableType.REAL)
    seconds = timed(partial(execution.step, steps), steps)()
    if not record:
        execution.add_observer(observer)
        position = [references["bench", "position"]]
        (positions[COSIM],) = observer.last_real_values(index["bench"], position)
    return seconds


def _reference(member: Member, variable: str) -> int:
    description = fmpy.read_model_description(str(member.fmu), validate=False)
    return next(int(v.valueReference) for v in description.modelVariables if v.name == variable)


def bundle(actuators: int) -> System:
    """Return a bench that pulls at many actuators at once and feels the first of them."""
    names = [f"actuator{i}" for i in range(actuators)]
    members = [Member.of("bench", component(_BENCH), {"hold": 0.0, "force_reference": 1.0})]
    members += [Member.of(name, component(_ACTUATOR), {"current": 0.5}) for name in names]
    wires = [f"bench.position -> {name}.length_change" for name in names]
    return System("bundle", tuple(members), connect(*wires, "actuator0.tension -> bench.tension"))


def life(quick: bool) -> Iterator[str | Table]:
    """Time five hours of a film: galvanostat, ageing actuator and estimator under our master."""
    duration, rounds = (20.0, 2) if quick else (ageing.LIFE, 5)
    durations: dict[str, Duration] = {
        "real time": lambda: duration,
        "the life": timed(partial(ageing.run, duration)),
    }
    times = take_turns(durations, rounds)
    yield comparison(times, {"the life": "real time"}, "s", {"the life": 1 / 2000})


RATES = (30, 100, 1000)  # Hz
MASTER = "the master, one actuator"
BARE = "a bare loop of sleeps"


def pacing(quick: bool) -> Iterator[str | Table]:
    """Measure how much later than its absolute deadline each communication point is reached."""
    seconds, rounds = (0.2, 2) if quick else (1.0, 5)
    actuator = Member.of("actuator", component("ppy_actuator"))
    inputs = {name: (Port("actuator", name),) for name in ("current", "force")}
    system = System("actuator", (actuator,), (), inputs)
    rows: list[list[Cell]] = []
    for rate in RATES:
        points = np.arange(max(3, round(seconds * rate)) + 1) / rate
        late: dict[str, list[float]] = {MASTER: [], BARE: []}
        runs = {
            MASTER: partial(_paced, system, points, late[MASTER]),
            BARE: partial(_sleep, points, late[BARE]),
        }
        take_turns({name: timed(run) for name, run in runs.items()}, rounds)
        for name, values in late.items():
            figures = 1e6 * np.percentile(values, [50.0, 99.0, 100.0])
            rows.append([f"{rate} Hz, {name}", *map(float, figures)])
    yield Table(["", "median, µs", "99 %, µs", "worst, µs"], rows)


def _paced(system: System, points: Array, late: list[float]) -> None:
    lags: list[float] = []
    pace = master.RealTime(watch=lambda k, values, lag, missed: lags.append(lag))
    inputs = {"current": np.full(points.size, 0.5), "force": np.full(points.size, 1.0)}
    master.run(system, points, inputs, real_time=pace)
    late += lags[2:]  # the watch hears of the point before; there is none before the second


def _sleep(points: Array, late: list[float]) -> None:
    start = time.perf_counter()
    for point in points[1:].tolist():
        while (left := start + point - time.perf_counter()) > 0.0:
            time.sleep(left)
        late.append(-left)
