"""Line 6: instances, and different FMUs, in one process do not see each other."""

from __future__ import annotations

import contextlib
import sys
import threading
from pathlib import Path

import pytest

from fmus import COMPONENTS, component
from fmus.kit import stack
from fmus.kit.build.building import RUNTIMES
from tests.contract.models import DoubledVoltage, Oscillator, Sampler
from tests.contract.raw import Instance, Library, instance, unzipped
from tests.contract.schedule import go, schedule
from tests.contract.subjects import EACH, TELLING, actuators_only, each_front_end
from tests.support import hosts
from tests.support.pace import slow_but

STEPS = 20


def alone(fmu: str, seed: int, parameters: dict[str, float] | None = None) -> bytes:
    """Run one FMU and nothing else."""
    with instance(fmu) as one:
        one.initialize(parameters)
        return go(one, schedule(one.library, seed, STEPS))


def interleaved(runs: list[tuple[str, int, dict[str, float]]]) -> list[bytes]:
    """Run several instances step by step in turn; the same FMU may be there several times."""
    with contextlib.ExitStack() as cleanup:
        libraries = {fmu: Library(cleanup.enter_context(unzipped(fmu))) for fmu, _, _ in runs}
        ones = [
            cleanup.enter_context(Instance(libraries[fmu], f"i{k}".encode()))
            for k, (fmu, _, _) in enumerate(runs)
        ]
        for one, (_, _, parameters) in zip(ones, runs, strict=True):
            one.initialize(parameters)
        plans = [
            schedule(one.library, seed, STEPS) for one, (_, seed, _) in zip(ones, runs, strict=True)
        ]
        trails = [b""] * len(runs)
        for k in range(STEPS):
            for i, one in enumerate(ones):
                trails[i] += go(one, [plans[i][k]])
        return trails


def together(
    runs: list[tuple[str, int, dict[str, float]]],
) -> tuple[list[bytes], list[str], list[str]]:
    """Run interleaved, with other names of modules and other search paths in the host's Python."""
    modules, paths = set(sys.modules), list(sys.path)
    trails = interleaved(runs)
    return trails, sorted(set(sys.modules) - modules), [p for p in sys.path if p not in paths]


@pytest.mark.slow
@each_front_end
def test_two_instances_run_as_each_alone(archive, subject):
    runs = [(str(archive), 1, {}), (str(archive), 2, dict(subject.parameters))]
    returncode, answer = hosts.in_subprocess(together, runs)
    assert returncode == 0, answer
    for (fmu, seed, parameters), trail in zip(runs, answer[0], strict=True):
        assert hosts.in_subprocess(alone, fmu, seed, parameters) == (0, trail)


@pytest.mark.slow
def test_all_fmus_in_one_process_run_as_each_alone(fmu, built):
    files = [fmu(name, runtime) for name in COMPONENTS for runtime in RUNTIMES]
    files += [built(cls, runtime) for cls in (Sampler, Oscillator) for runtime in RUNTIMES]
    runs = [(str(file), seed, {}) for seed, file in enumerate(files)]
    returncode, answer = hosts.in_subprocess(together, runs)
    assert returncode == 0, answer
    trails, modules, paths = answer
    assert trails == [hosts.in_subprocess(alone, file, seed)[1] for file, seed, _ in runs]
    assert not paths
    assert not [m for m in modules if m.partition(".")[0] == "fmus" or m.startswith("tests.")], (
        "modules of the host"
    )
    # each had a package of its own; of those whose instances are gone the last four are kept
    assert len({m.partition(".")[0] for m in modules if m.startswith("_ppy_fmu_")}) == min(
        4, len(files) // 2
    )


@actuators_only
def test_fmus_with_modules_of_one_name_keep_their_own_laws(fmu, built, name, runtime):
    other = stack(component(name), DoubledVoltage, name=name)
    pair = [str(fmu(name, runtime)), str(built(other, runtime))]
    assert Path(pair[0]).name == Path(pair[1]).name
    voltages = []
    with contextlib.ExitStack() as cleanup:
        ones = [cleanup.enter_context(instance(file)) for file in pair]
        for one in ones:
            one.initialize({"current": 0.9})
            one.step(0.1)
            voltages += one.get("voltage")
    assert voltages[1] == 2.0 * voltages[0]


@each_front_end
def test_instances_in_threads_run_as_each_alone(archive):
    with unzipped(archive) as folder:
        library = Library(folder)

        def run(seed: int, trails: dict[int, bytes]) -> None:
            with Instance(library) as one:
                one.initialize()
                trails[seed] = go(one, schedule(library, seed, STEPS))

        expected: dict[int, bytes] = {}
        found: dict[int, bytes] = {}
        for seed in range(4):
            run(seed, expected)
        threads = [threading.Thread(target=run, args=(seed, found)) for seed in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert found == expected


@pytest.mark.parametrize(("name", "first"), slow_but(EACH, *TELLING))
def test_an_instance_outlives_others(fmu, name, subject, first):
    second = {"python": "native", "native": "python"}[first]
    with instance(fmu(name, first)) as one:
        one.initialize(subject.inputs)
        one.step(0.1)
        before = one.save()
        one.step(0.1)
        expected = one.everything()
        for runtime in (first, second) * 3:
            with instance(fmu(name, runtime)) as other:
                other.initialize(subject.parameters)
                other.step(0.3)
        one.restore(before)
        one.time = 0.1
        one.step(0.1)
        assert one.everything() == expected
