"""Claims: what pins and flanges connect in Modelica moves as the system of FMUs in our master.

Inputs go straight from knot to knot.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fmus
from fmus.kit import stack
from fmus.kit.modelica import package_files
from orchestration.system import library
from tests.support.modelica import (
    Courses,
    assert_same,
    extrapolated,
    flatten_by_pymoca,
    parse_by_pymoca,
    simulate_by_pymoca,
    simulate_by_rumoca,
    sources,
    write,
)

ROOT = Path(__file__).parents[2]
NAMES = ("galvanostat", "ppy_actuator", "ppy_actuator_length_driven", "voice_coil_dma")
STOP = 0.2
POINTS = 6000  # of the coarsest run; all samples of the bench are at some
COMPARED = 120  # distances between points that are compared
MUSCLES = ("an", "po", "do", "pl")


def taut_foot():
    return stack(
        fmus.component("foot_dynamic"),
        fmus.effects("foot_dynamic")["tension_stiffness"],
        name="taut_foot",
    )


@pytest.fixture(scope="module")
def files():
    return package_files([*map(fmus.component, NAMES), taut_foot()], "0")


@pytest.fixture(scope="module")
def folder(files, tmp_path_factory):
    folder = tmp_path_factory.mktemp("circuits")
    write(files, folder)
    return folder / "PpyRig"


def modifiers(system, member, cls):
    """Return the values that a system gives to a member's parameters, as modifiers."""
    given = next(m for m in system.members if m.name == member).parameters
    types = {p.name: p.type for p in cls.layout.parameters}
    texts = {
        name: repr(value) if types[name] == "real" else str(bool(value)).lower()
        for name, value in given.items()
        if name in types
    }
    return ", ".join(f"{name}={text}" for name, text in texts.items())


# --- a foot and its four actuators ---------------------------------------------------------------

_KNOTS = np.linspace(0.0, STOP, 5)
_CURRENT = np.array([0.0, 0.5, -0.3, 0.8, 0.2])
GAIT = {f"{name}_current": (_KNOTS, _CURRENT * (k + 1) / 4.0) for k, name in enumerate(MUSCLES)} | {
    "toe_force_x": (_KNOTS, np.array([0.0, 0.1, -0.1, 0.2, 0.0])),
    "toe_force_y": (_KNOTS, np.array([0.0, 0.05, 0.1, -0.05, 0.0])),
}


def gait(system):
    """Return a foot with actuators, each between a flange of it and the leg, which is held."""
    film = fmus.component("ppy_actuator_length_driven")
    lines = [f"model Gait PpyRig.TautFoot foot({modifiers(system, 'foot', taut_foot())});"]
    lines += ["Sources.FlangeGround leg; Sources.FlangeFlow fx; Sources.FlangeFlow fy;"]
    lines += [f"input Real {name};" for name in GAIT]
    for name in MUSCLES:
        lines += [
            f"PpyRig.PpyActuatorLengthDriven {name}({modifiers(system, name, film)});",
            f"Sources.PinFlow {name}_source; Sources.PinGround {name}_ground;",
        ]
    lines += ["equation", "fx.u = toe_force_x; fy.u = toe_force_y;"]
    for name in MUSCLES:
        lines += [
            f"{name}_source.u = {name}_current;",
            f"connect({name}_source.a, {name}.p); connect({name}_source.b, {name}.n);",
            f"connect({name}_ground.c, {name}.n);",
            f"connect(foot.{name}, {name}.flange_b); connect(leg.c, {name}.flange_a);",
        ]
    for axis in "xy":
        flange = f"foot.toe_flange_{axis}"
        lines.append(f"connect(f{axis}.a, {flange}); connect(f{axis}.b, leg.c);")
    return "\n".join([*lines, "end Gait;"])


@pytest.mark.slow
def test_a_foot_hangs_on_the_flanges_of_its_actuators(files):
    system = library.system("foot_gait")
    tree = parse_by_pymoca(files, [sources(), gait(system)])
    times = np.linspace(0.0, STOP, COMPARED + 1)
    inputs = Courses(_KNOTS, {name: course[1] for name, course in GAIT.items()})
    simulated = simulate_by_pymoca(tree, "Gait", inputs, times)
    shown = [f"foot.{joint}_angle" for joint in ("ankle", "tm", "mtp")]
    shown += ["foot.toe_x", "foot.toe_y"]
    shown += [f"{name}.{each}" for name in MUSCLES for each in ("tension", "charge", "voltage")]
    assert_same(simulated, extrapolated(system, GAIT, shown, STOP, POINTS, COMPARED), slice(None))


# --- a galvanostat, an actuator and the analyser -------------------------------------------------

_DRIVEN = {"current_command": 0.9, "force_reference": 1.0}
BENCH = """
model Bench
  PpyRig.Galvanostat galvanostat({galvanostat}, current_command=0.9, voltage_limit=0.36,
    voltage_command=0.0);
  PpyRig.PpyActuatorLengthDriven actuator({actuator});
  PpyRig.VoiceCoilDma bench({bench}, force_reference=1.0);
  Sources.PinGround ground;
  Sources.FlangeGround frame;
equation
  connect(galvanostat.p, actuator.p);
  connect(galvanostat.n, actuator.n);
  connect(ground.c, actuator.n);
  connect(actuator.flange_b, bench.flange);
  connect(actuator.flange_a, frame.c);
  connect(galvanostat.recovering, bench.hold);
end Bench;
"""
MEMBERS = {
    "galvanostat": "galvanostat",
    "actuator": "ppy_actuator_length_driven",
    "bench": "voice_coil_dma",
}


def bench_system():
    """Return the bench with protection; a count of a converter is more than what is compared."""
    system = library.system("protected_bench")
    values = {
        "galvanostat": {"voltage_limit": 0.36, "recovery_time": 0.03},
        "bench": {"converters_on": 0.0},
    }
    members = [
        replace(m, parameters=dict(m.parameters) | values.get(m.name, {})) for m in system.members
    ]
    return replace(system, members=tuple(members))


def bench(system):
    texts = {
        member: modifiers(system, member, fmus.component(name)) for member, name in MEMBERS.items()
    }
    return BENCH.format(**texts).replace("(, ", "(").replace("()", "")


def test_a_galvanostat_an_actuator_and_the_analyser_share_pins_and_flanges(folder):
    """The protection takes the current away, and gives it back; the controller rests meanwhile."""
    system = bench_system()
    inputs = {name: (np.array([0.0, STOP]), np.full(2, value)) for name, value in _DRIVEN.items()}
    shown = ["galvanostat.current", "actuator.voltage", "actuator.charge", "actuator.tension"]
    shown += ["bench.position", "bench.velocity", "bench.coil_voltage", "bench.force_measured"]
    wanted = extrapolated(system, inputs, shown, STOP, POINTS, COMPARED)
    assert {0.0, 0.9} <= set(wanted["galvanostat.current"].round(12)), "no recovery"
    simulated = simulate_by_rumoca(
        folder, [sources(), bench(system)], "Bench", STOP, STOP / COMPARED, tolerance=1e-11
    )
    # the master shows what is before a sample: away from those
    places = np.array([k for k in range(COMPARED + 1) if k % 6 and k % 20])
    nearest = [np.abs(simulated["time"] - STOP * k / COMPARED).argmin() for k in places]
    assert_same(simulated, {name: values[places] for name, values in wanted.items()}, nearest)


@pytest.mark.slow
def test_pymoca_flattens_the_bench_into_as_many_equations_as_variables(files):
    system = bench_system()
    flat = flatten_by_pymoca(parse_by_pymoca(files, [sources(), bench(system)]), "Bench")
    unknown = [
        name
        for name, symbol in flat.symbols.items()
        if "parameter" not in symbol.prefixes and symbol.value.value is None
    ]
    count = sum(len(e.blocks[0]) if hasattr(e, "blocks") else 1 for e in flat.equations)
    assert count == len(unknown)


# --- connectors of another library ---------------------------------------------------------------

# of the Modelica Standard Library 4.0, what the page uses: same variables, classes of its own
STANDARD_LIBRARY = """
package Modelica
  package Electrical
    package Analog
      package Interfaces
        connector Pin Real v(unit="V"); flow Real i(unit="A"); end Pin;
      end Interfaces;
      package Basic
        model Ground Interfaces.Pin p; equation p.v = 0.0; end Ground;
      end Basic;
    end Analog;
  end Electrical;
  package Mechanics
    package Translational
      package Interfaces
        connector Flange_b Real s(unit="m"); flow Real f(unit="N"); end Flange_b;
      end Interfaces;
      package Components
        model Fixed parameter Real s0 = 0.0; Interfaces.Flange_b flange; equation flange.s = s0;
        end Fixed;
      end Components;
    end Translational;
  end Mechanics;
end Modelica;
"""


def test_the_model_of_the_page_connects_to_connectors_of_another_library(folder):
    page = (ROOT / "docs" / "how-to" / "other-tools.md").read_text(encoding="utf-8")
    model = re.search(r"```modelica\n(.+?)```", page, re.S)[1]
    simulated = simulate_by_rumoca(folder, [STANDARD_LIBRARY, model], "Clamped", 2.0, 0.5)
    # into a circuit that is empty, R2 i = Q/C + (R1 + R2) dQ/dt
    film = fmus.component("ppy_actuator")()
    rate = 1.0 / ((film.R1 + film.R2) * film.C)
    charge = film.R2 * 0.5 * film.C * (1.0 - np.exp(-rate * 2.0))
    assert simulated["actuator.charge"][-1] == pytest.approx(charge, rel=1e-7)
    assert simulated["actuator.flange_b.f"] == pytest.approx(0.0, abs=1e-15)
