"""Claims: models of Modelica, compiled by others, move as their FMUs do.

Inputs go straight from value to value of the component's own reference; they are compared away from
knots and from samples, where both sides of an instant are there.
"""

import csv
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import fmus
from fmus import COMPONENTS
from fmus.kit.build import build_cached
from fmus.kit.modelica import class_name, package_files
from tests.support.modelica import (
    Courses,
    driven,
    flatten_by_pymoca,
    parse_by_pymoca,
    simulate_by_pymoca,
    simulate_by_rumoca,
    simulate_fmu,
    sources,
    write,
)

# pymoca 0.12 knows no sample; all others are rumoca's alone
CONTINUOUS = [name for name in COMPONENTS if not fmus.component(name).layout.sampled]
_LEVELS = 12  # values of the reference that inputs go through
_STEPS = {"foot_free": 0.0025}  # touches of the ground are short


@pytest.fixture(scope="module")
def files():
    return package_files([fmus.component(name) for name in COMPONENTS], "0")


@pytest.fixture(scope="module")
def folder(files, tmp_path_factory):
    folder = tmp_path_factory.mktemp("modelica")
    write(files, folder)
    return folder / "PpyRig"


def courses_of(name):
    """Return a component's inputs, and the communication step."""
    cls = fmus.component(name)
    path = Path(sys.modules[cls.__module__].__file__).parent / "reference" / f"{name}_in.csv"
    with path.open(encoding="utf-8") as file:
        (_, *names), *rows = csv.reader(file)
    table = np.array(rows, dtype=float)
    levels = table[:-1][np.diff(table[:, 0]) > 0.0, 1:]
    count = min(_LEVELS, len(levels))
    levels = levels[np.linspace(0, len(levels) - 1, count).round().astype(int)]
    step = _STEPS.get(name, cls.experiment[1] / 2.0)
    steps_of_a_level = 6
    if cls.layout.sampled:
        starts = {p.name: p.start for p in cls.layout.parameters}
        step = min(starts.get(c.period, c.period) for c, _ in cls.layout.sampled) / 2.0
    knots = step * np.array([0, *(2 * steps_of_a_level * k + 1 for k in range(1, count))])
    values = {each: levels[:, k] for k, each in enumerate(names)}
    held = {v.name for v in cls.layout.inputs if v.type == "boolean"}
    for port in cls.ports:
        if port.rate:
            slopes = np.diff(values[port.potential]) / np.diff(knots)
            values[port.rate] = np.append(slopes, slopes[-1])
            held.add(port.rate)
    return Courses(knots, values, frozenset(held)), step


@cache
def by_fmpy(name):
    """Return what the FMU gives, with the places of the times that are compared."""
    courses, step = courses_of(name)
    times = step * np.arange(round(courses.times[-1] / step) + 1)
    given = simulate_fmu(build_cached(fmus.component(name), "native"), courses, times)
    off_knots = np.abs(times[:, None] - courses.times).min(axis=1) > step / 2.0
    return times, given, np.flatnonzero(off_knots & (np.arange(len(times)) % 2 == 1))


def moved(cls, courses):
    """Return inputs that are given; a rate follows from its potential."""
    rates = {port.rate for port in cls.ports}
    return [name for name in courses.values if name not in rates]


def assert_agree(name, simulated, tolerance=1e-6):
    times, given, places = by_fmpy(name)
    nearest = [int(np.abs(simulated["time"] - times[k]).argmin()) for k in places]
    assert np.abs(simulated["time"][nearest] - times[places]).max() < 1e-9
    moving = 0
    for output, wanted in given.items():
        value = np.asarray(simulated[f"m.{output}"], dtype=float)[nearest]
        scale = np.abs(wanted[places]).max()
        assert np.abs(value - wanted[places]).max() <= tolerance * scale, output
        moving += np.ptp(wanted[places]) > 0.0
    assert moving, "nothing moved"


@pytest.mark.parametrize("name", COMPONENTS)
def test_pymoca_flattens_it_into_as_many_equations_as_variables(name, files):
    model = f"PpyRig.{class_name(name)}"
    flat = flatten_by_pymoca(parse_by_pymoca(files), model)
    unknown = [s for s in flat.symbols.values() if "parameter" not in s.prefixes]
    cls = fmus.component(name)
    at_ports = {n for port in cls.ports for n in port.variables}
    given = [v for v in cls.layout.inputs if v.name not in at_ports]
    equations = sum(len(e.blocks[0]) if hasattr(e, "blocks") else 1 for e in flat.equations)
    assert equations == len(unknown) - len(given)


@pytest.mark.parametrize("name", COMPONENTS)
def test_rumoca_simulates_it_as_its_fmu_moves(name, folder):
    cls = fmus.component(name)
    courses, step = courses_of(name)
    texts = {each: courses.text(each) for each in moved(cls, courses)}
    model = driven(cls, f"PpyRig.{class_name(name)}", texts)
    stop = float(courses.times[-1])
    assert_agree(name, simulate_by_rumoca(folder, [sources(), model], "Driven", stop, step))


@pytest.mark.parametrize("name", CONTINUOUS)
def test_what_pymoca_gives_casadi_moves_as_its_fmu(name, files):
    cls = fmus.component(name)
    courses, _ = courses_of(name)
    names = {each: f"u_{each}" for each in moved(cls, courses)}
    text = driven(cls, f"PpyRig.{class_name(name)}", names)
    declared = "".join(f"input Real {u};\n" for u in names.values())
    tree = parse_by_pymoca(files, [sources(), text.replace("equation", f"{declared}equation", 1)])
    forced = {f"m.{port.potential}": names[port.potential] for port in cls.ports if port.rate}
    inputs = Courses(courses.times, {u: courses.values[each] for each, u in names.items()})
    simulated = simulate_by_pymoca(tree, "Driven", inputs, by_fmpy(name)[0], forced)
    assert_agree(name, simulated)


def test_a_difference_is_seen(folder):
    """Of a parameter by a ten-thousandth."""
    cls = fmus.component("ppy_actuator")
    courses, step = courses_of("ppy_actuator")
    texts = {each: courses.text(each) for each in courses.values}
    model = driven(cls, "PpyRig.PpyActuator", texts).replace(" m;", " m(R1=0.430043);")
    simulated = simulate_by_rumoca(
        folder, [sources(), model], "Driven", float(courses.times[-1]), step
    )
    with pytest.raises(AssertionError, match=r"^(charge|voltage)"):
        assert_agree("ppy_actuator", simulated)
