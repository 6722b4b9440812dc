"""Claims: examples of the package compile as they stand, and move as systems of FMUs do."""

import re
from functools import cache

import numpy as np
import pytest
import rumoca

import fmus
from fmus import COMPONENTS
from fmus.kit import registry
from fmus.kit.modelica import class_name, package_files
from orchestration.system import library
from tests.support.modelica import (
    assert_same,
    extrapolated,
    flatten_by_pymoca,
    parse_by_pymoca,
    simulate_by_rumoca,
    write,
)
from tests.support.modelica_units import misfits

EXAMPLES = {example.system.name: example for example in registry.examples()}
COMPARED = 60  # distances between points that are compared
# stop time in s, and distances between points of the coarsest run: all samples are at points
RUNS = {
    "clamped_actuator": (0.3, 600),
    "dma_bench": (0.2, 6000),
    "protected_bench": (0.2, 6000),
    "isotonic_stand": (0.3, 600),
    "foot_gait": (0.2, 6000),
    "foot_stance": (0.2, 6000),
    "degradation_watch": (1.2, 600),
    "potentiostat_watch": (0.2, 600),
    "work_loop": (0.3, 600),
    "displacement_loop": (0.3, 600),
    "state_feedback_loop": (0.3, 600),
    "adaptive_loop": (0.3, 600),
    "tension_loop": (0.21, 840),
    "impedance_bench": (0.2, 6000),
}


@pytest.fixture(scope="module")
def files():
    return package_files([fmus.component(name) for name in COMPONENTS], "0")


@pytest.fixture(scope="module")
def folder(files, tmp_path_factory):
    folder = tmp_path_factory.mktemp("examples")
    write(files, folder)
    return folder / "PpyRig"


@pytest.fixture(scope="module")
def tree(files):
    return cache(lambda: parse_by_pymoca(files))


def derived(name):
    return f"model Run extends PpyRig.Examples.{class_name(name)}; end Run;"


def test_every_system_without_a_rig_is_an_example():
    proxied = {
        name
        for name, system in registry.systems().items()
        if {m.component for m in system.members.values()} & registry.proxies().keys()
    }
    assert EXAMPLES.keys() == RUNS.keys()
    assert registry.systems().keys() - EXAMPLES.keys() == proxied


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_it_says_how_long_to_simulate_it(name, files):
    system = EXAMPLES[name].system
    text = files[f"PpyRig/Examples/{class_name(name)}.mo"].decode()
    stop, interval, tolerance = map(
        float,
        re.search(r"experiment\(StopTime=(.+), Interval=(.+), Tolerance=(.+)\)\)", text).groups(),
    )
    assert stop == system.stop
    assert stop / interval == pytest.approx(500)
    assert tolerance in (1e-8, 1e-9, 1e-11)
    assert f'"{system.summary.rstrip(".")}"' in text


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_pymoca_flattens_it_into_as_many_equations_as_variables_whose_units_fit(name, tree):
    flat = flatten_by_pymoca(tree(), f"PpyRig.Examples.{class_name(name)}")
    unknown = [
        name
        for name, symbol in flat.symbols.items()
        if "parameter" not in symbol.prefixes and symbol.value.value is None
    ]
    count = sum(len(e.blocks[0]) if hasattr(e, "blocks") else 1 for e in flat.equations)
    assert count == len(unknown)
    members = EXAMPLES[name].system.members.values()
    unchecked = sum(len(fmus.component(m.component).unchecked) for m in members)
    found, compared = misfits(flat)
    assert len(found) <= unchecked, found
    assert compared > 5


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_rumoca_simulates_it_as_the_master_runs_its_system(name, folder):
    example = EXAMPLES[name]
    stop, points = RUNS[name]
    inputs = {key: (np.array([0.0, stop]), np.full(2, u)) for key, u in example.inputs.items()}
    system = library.build(example.system)
    wanted = extrapolated(system, inputs, example.system.outputs, stop, points, COMPARED)
    simulated = simulate_by_rumoca(
        folder, [derived(name)], "Run", stop, stop / COMPARED, tolerance=1e-11
    )
    # the master shows what is before a sample: away from the instants of events, which are twice
    grid = stop / COMPARED * np.arange(COMPARED + 1)
    count = np.array([(np.abs(simulated["time"] - t) < 1e-9).sum() for t in grid])
    places = np.flatnonzero((count == 1) & (grid > 0.0))
    assert len(places) > COMPARED / 3
    nearest = [np.abs(simulated["time"] - grid[k]).argmin() for k in places]
    values = {name: each[places] for name, each in wanted.items()}
    still = {name for name, each in values.items() if np.ptp(each) == 0.0}
    assert still < values.keys()
    assert_same(simulated, values, nearest, still)


@pytest.mark.slow
def test_rumoca_compiles_all_into_as_many_equations_as_unknowns(folder):
    session = rumoca.Session(roots=[str(folder)])
    unbalanced = [
        name
        for name in EXAMPLES
        if not session.loads(derived(name), model="Run").structure().is_balanced
    ]
    assert not unbalanced
