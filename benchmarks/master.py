"""The master against libcosim and Ecos: the same native FMUs and Jacobi steps, in turns."""

from __future__ import annotations

import ctypes
import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fmus import component
from fmus.kit.build.building import build_cached
from fmus.kit.record.compiled import CompiledModel
from orchestration import master
from orchestration.fmu.instance import Fmu
from orchestration.master.reference.fused import fuse
from orchestration.system import library
from orchestration.system.model import Member, Port, System, connect
from tests.support import hosts

from .record import exponent
from .tables import Cell, Table, Topic
from .timing import Times

OURS = "ours, Jacobi"
OURS_IN_TURN = "ours, Gauss–Seidel"
CALLS = "its FMI calls alone, in a loop in Python"
ECOS = "Ecos"
COSIM = "libcosim"
FUSED = "ours, fused"
ALONE = "Steps alone"
RECORDED = "Every output recorded"
STEP = 1e-3  # s
INPUTS = {"force_reference": 1.0, "current": 0.5}
AGREEMENT = 1e-9
_AS_OTHERS = {"method": "jacobi", "feedthrough": False, "record": ["bench.position"]}
_SIZES = (2, 4, 8, 16, 32, 64)
_LENGTHS = (1000, 4000, 16000)

Timed = Callable[[], float]


def measure(quick: bool = False) -> Topic:
    """Time all masters on `dma_bench`, and ours on systems of growing size and length."""
    steps, rounds = (100, 2) if quick else (5000, 15)
    library.system("dma_bench")  # built here, not in the measuring process
    finished = hosts.finish_in_subprocess(compare, steps, rounds, clean_exit=False, timeout=600.0)
    if finished.result is None:
        raise RuntimeError(
            f"the measuring process ended with return code {finished.returncode}\n{finished.output}"
        )
    alone = finished.result[ALONE]
    floor, remaining = (alone.median_ratio(name, ECOS) for name in (CALLS, OURS))
    recorded = finished.result[RECORDED].median_ratio(OURS, ECOS)
    parts: list[str | Table] = [
        (
            f"`dma_bench` as native FMUs, a Jacobi step of {STEP:g} s, time per step without"
            " opening and initialization. All in one process, in turns; that all come to the same"
            " position was verified. The first table is of stepping alone, with values exchanged"
            " as libcosim and Ecos do it (`feedthrough=False`); ours keeps one signal. In the"
            " second every output is recorded at every step: ours and libcosim in memory, Ecos in"
            " a CSV file, for want of another place."
        ),
        (
            f"Stepping alone, ours takes {alone.median_ratio(OURS, COSIM):.2g} of libcosim's time"
            f" and {remaining:.2g} of that of Ecos; recording every output, {recorded:.2g} of that"
            " of Ecos. A kernel in C makes the steps. To call the six FMI functions from Python,"
            f" as it is done where there is no compiler, takes {floor:.2g} of Ecos' time already."
        ),
    ]
    for title, times in finished.result.items():
        rows: list[list[Cell]] = [
            [name, times.best(name) / steps * 1e6, times.median_ratio(OURS, name)]
            for name in times.seconds
        ]
        parts += [
            f"{title}:",
            Table(["master", "best, µs", "median of ours, Jacobi, over it"], rows),
        ]
    parts += _growth(quick)
    return Topic("Co-simulation masters", parts)


# --- in the measuring process
# ---------------------------------------------------------------------------------------


def compare(steps: int, rounds: int) -> dict[str, Times]:
    """Time the masters in turns; by whether they record."""
    system = library.system("dma_bench")
    positions = dict[str, float]()
    with ExitStack() as opened:
        bare = {
            OURS: lambda: _ours(system, steps, positions, OURS, **_AS_OTHERS),
            CALLS: _calls(system, steps, opened),
            ECOS: lambda: _ecos(system, steps, positions, None),
            COSIM: lambda: _libcosim(system, steps, positions, False),
        }
        folder = opened.enter_context(tempfile.TemporaryDirectory(prefix="benchmark_"))
        recorded = {
            OURS: lambda: _ours(system, steps, {}, OURS, method="jacobi"),
            OURS_IN_TURN: lambda: _ours(system, steps, {}, OURS_IN_TURN),
            ECOS: lambda: _ecos(system, steps, {}, Path(folder, "ecos.csv")),
            COSIM: lambda: _libcosim(system, steps, {}, True),
            FUSED: _fused(system, steps),
        }
        found = {ALONE: _in_turns(bare, rounds), RECORDED: _in_turns(recorded, rounds)}
    check_agreement(positions)
    return found


def check_agreement(positions: Mapping[str, float]) -> None:
    """All masters came to the same position, or their times mean nothing; RuntimeError if not."""
    for name, position in positions.items():
        if abs(position - positions[OURS]) > AGREEMENT * abs(positions[OURS]):
            raise RuntimeError(
                f"{name}: position {position!r} after the last step, ours {positions[OURS]!r}"
            )


def _in_turns(actions: Mapping[str, Timed], rounds: int) -> Times:
    """As `timing.take_turns`, for actions that time a part of themselves."""
    names = list(actions)
    seconds = {name: np.empty(rounds) for name in names}
    for k in range(-1, rounds):  # the first does not count
        for name in names[k % len(names) :] + names[: k % len(names)]:
            seconds[name][k] = actions[name]()
    return Times(seconds)


def _points(steps: int) -> NDArray[np.float64]:
    return STEP * np.arange(steps + 1, dtype=np.float64)


def _ours(
    system: System, steps: int, positions: dict[str, float], name: str, **options: object
) -> float:
    inputs = {key: np.full(steps + 1, value) for key, value in INPUTS.items()}
    result = master.run(system, _points(steps), inputs, **options)  # type: ignore[arg-type]
    positions[name] = float(result.signals["bench.position"][-1])
    return result.statistics.wall


def _fused(system: System, steps: int) -> Timed:
    model = CompiledModel(fuse(system))
    time_points = _points(steps)
    inputs = {key: np.full(steps + 1, value) for key, value in INPUTS.items()}

    def go() -> float:
        begin = time.perf_counter()
        model.run(time_points, inputs)
        return time.perf_counter() - begin

    return go


def _calls(system: System, steps: int, opened: ExitStack) -> Timed:
    """Bind the calls of a Jacobi step as the master does, with nothing in between."""
    now = ctypes.c_double()
    size = ctypes.c_double(STEP)
    calls = []
    done = 0
    for member in system.members:
        fmu = opened.enter_context(Fmu(member.fmu, member.parameters))
        fmu.start()
        calls.append(fmu.bound("fmi2DoStep", now, size, ctypes.c_int(1)))
        for verb, names in (
            ("Set", ["tension", "force_reference", "length_change", "current"]),
            ("Get", fmu.outputs),
        ):
            references = [
                fmu.variables[name].valueReference for name in names if name in fmu.variables
            ]
            count = len(references)
            values = (ctypes.c_double * len(references))()
            shown = ctypes.byref((ctypes.c_uint * count)(*references))
            calls.append(
                fmu.bound(f"fmi2{verb}Real", shown, ctypes.c_size_t(count), ctypes.byref(values))
            )

    def go() -> float:
        nonlocal done
        begin = time.perf_counter()
        for k in range(done, done + steps):
            now.value = k * STEP
            for call in calls:
                call()
        done += steps
        return time.perf_counter() - begin

    return go


def _reference(system: System, port: Port) -> int:
    with_names = _references(str(system.member(port.member).fmu))
    return with_names[port.variable]


def _references(fmu: str) -> dict[str, int]:
    import fmpy

    return {
        v.name: v.valueReference
        for v in fmpy.read_model_description(fmu, validate=False).modelVariables
    }


def _outputs(system: System) -> list[Port]:
    return [
        Port(member.name, v.name)
        for member in system.members
        if member.cls is not None
        for v in member.cls.layout.measurable
    ]


def _ecos(system: System, steps: int, positions: dict[str, float], file: Path | None) -> float:
    hosts.preload_tbb()
    from ecospy import EcosSimulation, EcosSimulationStructure  # type: ignore[import-untyped]

    structure = EcosSimulationStructure()
    for member in system.members:
        structure.add_model(member.name, str(member.fmu))
    for c in system.connections:
        structure.make_real_connection(
            *(f"{port.member}::{port.variable}" for port in (c.source, c.target))
        )
    values = {
        f"{p.member}::{p.variable}": INPUTS[name]
        for name, ports in system.inputs.items()
        for p in ports
    }
    structure.add_parameter_set("start", values)
    simulation = EcosSimulation(structure=structure, step_size=STEP)
    try:
        if file is not None:
            simulation.add_csv_writer(
                str(file), identifiers=[f"{p.member}::{p.variable}" for p in _outputs(system)]
            )
        simulation.init(0.0, "start")
        begin = time.perf_counter()
        simulation.step(steps)
        spent = time.perf_counter() - begin
        positions[ECOS] = simulation.get_real("bench::position")
        simulation.terminate()
    finally:
        simulation.free()
        structure.free()
    return spent


def _libcosim(system: System, steps: int, positions: dict[str, float], record: bool) -> float:
    from libcosimpy.CosimEnums import CosimVariableType  # type: ignore[import-untyped]
    from libcosimpy.CosimExecution import CosimExecution  # type: ignore[import-untyped]
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level  # type: ignore[import-untyped]
    from libcosimpy.CosimObserver import CosimObserver  # type: ignore[import-untyped]
    from libcosimpy.CosimSlave import CosimLocalSlave  # type: ignore[import-untyped]

    log_output_level(CosimLogLevel.ERROR)
    execution = CosimExecution.from_step_size(round(STEP * hosts.NANOSECONDS))
    slaves = {
        member.name: execution.add_local_slave(
            CosimLocalSlave(fmu_path=str(member.fmu), instance_name=member.name)
        )
        for member in system.members
    }
    for c in system.connections:
        ends = [(slaves[port.member], _reference(system, port)) for port in (c.source, c.target)]
        execution.connect_real_variables(*ends[0], *ends[1])
    for name, ports in system.inputs.items():
        for port in ports:
            execution.real_initial_value(
                slaves[port.member], _reference(system, port), INPUTS[name]
            )
    observer = CosimObserver.create_last_value()
    if record:
        observer = CosimObserver.create_time_series(buffer_size=steps)
        execution.add_observer(observer)
        for port in _outputs(system):
            observer.start_time_series(
                slaves[port.member], _reference(system, port), CosimVariableType.REAL
            )
    begin = time.perf_counter()
    execution.step(steps)
    spent = time.perf_counter() - begin
    if not record:
        execution.add_observer(observer)
        position = _reference(system, Port("bench", "position"))
        positions[COSIM] = observer.last_real_values(slaves["bench"], [position])[0]
    return spent


# --- growth
# --------------------------------------------------------------------------------------------------


def bundle(actuators: int) -> System:
    """Return a bench that pulls at many actuators at once and feels the first of them."""
    bench, actuator = (
        build_cached(component(f), "native")
        for f in ("voice_coil_dma", "ppy_actuator_length_driven")
    )
    names = [f"actuator{i}" for i in range(actuators)]
    members = [Member("bench", bench, {"hold": 0.0, "force_reference": 1.0})]
    members += [Member(name, actuator, {"current": 0.5}) for name in names]
    wires = [f"bench.position -> {name}.length_change" for name in names]
    return System("bundle", tuple(members), connect(*wires, "actuator0.tension -> bench.tension"))


def _growth(quick: bool) -> list[str | Table]:
    sizes, lengths, rounds = (_SIZES[:2], (20, 40), 1) if quick else (_SIZES, _LENGTHS, 5)
    points = lengths[0]

    def of_size(actuators: int) -> Timed:
        system = bundle(actuators)
        return lambda: master.run(system, _points(points), method="jacobi").statistics.wall

    def of_length(steps: int) -> Timed:
        system = bundle(2)
        return lambda: master.run(system, _points(steps), method="jacobi").statistics.wall

    grown = _in_turns({str(n): of_size(n) for n in sizes}, rounds)
    longer = _in_turns({str(n): of_length(n) for n in lengths}, rounds)
    rows: list[list[Cell]] = [
        [n, grown.best(str(n)) / points * 1e6, grown.best(str(n)) / points / (n + 1) * 1e6]
        for n in sizes
    ]
    rows_longer: list[list[Cell]] = [
        [n, longer.best(str(n)), longer.best(str(n)) / n * 1e6] for n in lengths
    ]
    slope = np.polyfit(sizes, [grown.best(str(n)) / points * 1e6 for n in sizes], 1)[0]
    return [
        (
            f"Ours, a bench with more and more actuators, every output recorded: {slope:.3g} µs for"
            " another actuator."
        ),
        Table(["actuators", "best, µs for a step", "µs for a step and a member"], rows),
        (
            "And with 2 actuators over longer and longer times: time grows as steps to the power "
            f"{exponent(longer, lengths):.2f}."
        ),
        Table(["steps", "best, s", "µs for a step"], rows_longer),
    ]
