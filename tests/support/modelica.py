"""Models of Modelica compiled and simulated by two compilers that know nothing of the kit.

pymoca flattens any of them, and gives equations to CasADi where nothing is sampled; rumoca
simulates what is sampled, too. Both are driven through connectors, by sources that are written
here.
"""

from __future__ import annotations

import logging
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import fmpy
import numpy as np
import pymoca.ast
import pymoca.parser
import pymoca.tree
import rumoca
import scipy.integrate
from fmpy.fmi2 import FMU2Slave
from pymoca.backends.casadi.generator import generate

from fmus.kit import Component
from orchestration import master
from orchestration.system import System

logging.getLogger("pymoca").setLevel(logging.ERROR)
if not hasattr(ca.MX, "__div__"):
    ca.MX.__div__ = ca.MX.__truediv__  # pymoca 0.12 divides by the name that Python 2 had
_CONNECTORS = {
    "electrical": ("Pin", "v", "i"),
    "translational": ("Flange", "s", "f"),
    "rotational": ("RotationalFlange", "phi", "tau"),
    "thermal": ("HeatPort", "T", "Q_flow"),
}


def write(files: Mapping[str, bytes], folder: Path) -> None:
    """Write files of a package into a folder."""
    for path, contents in files.items():
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(contents)


def sources() -> str:
    """Return a package of sources and grounds of all domains."""
    texts = ["package Sources"]
    for name, potential, flow in _CONNECTORS.values():
        connector = f"PpyRig.Interfaces.{name}"
        texts += [
            f"  model {name}Ground {connector} c; equation c.{potential} = 0.0; end {name}Ground;",
            f"  model {name}Flow {connector} a; {connector} b; Real u;",
            f"  equation a.{flow} = -u; a.{flow} + b.{flow} = 0.0; end {name}Flow;",
            f"  model {name}Potential {connector} a; {connector} b; Real u;",
            f"  equation a.{potential} - b.{potential} = u; a.{flow} + b.{flow} = 0.0;",
            f"  end {name}Potential;",
        ]
    return "\n".join([*texts, "end Sources;"])


def driven(cls: type[Component], model: str, courses: Mapping[str, str]) -> str:
    """Return a model ``Driven`` that has one as ``m``, with sources of its inputs.

    Parameters
    ----------
    cls : type[Component]
    model : str
        Its name, with the package.
    courses : Mapping of str to str
        Expressions for inputs by name; of the others the start value.
    """
    declarations = [f"{model} m;"]
    equations = []
    inputs = {v.name: v for v in cls.layout.inputs}
    rates = {port.rate for port in cls.ports}

    def course(name: str) -> str:
        start = inputs[name].start
        default = ("true" if start else "false") if inputs[name].type == "boolean" else repr(start)
        return courses.get(name, default)

    for k, port in enumerate(cls.ports):
        connector, _, _ = _CONNECTORS[port.domain]
        given = port.flow if port.flow in inputs else port.potential
        kind = "Flow" if given == port.flow else "Potential"
        sign = "-" if kind == "Flow" and port.delivers else ""
        declarations += [f"Sources.{connector}{kind} s{k};", f"Sources.{connector}Ground g{k};"]
        equations += [
            f"s{k}.u = {sign}({course(given)});",
            f"connect(s{k}.a, m.{port.connectors[0]});",
            f"connect(s{k}.b, g{k}.c);",
        ]
        if len(port.connectors) == 2:
            equations.append(f"connect(s{k}.b, m.{port.connectors[1]});")
        inputs.pop(given)
    equations += [f"m.{name} = {course(name)};" for name in inputs if name not in rates]
    return "\n".join(["model Driven", *declarations, "equation", *equations, "end Driven;"])


# --- inputs and FMUs -----------------------------------------------------------------------------


@dataclass(frozen=True)
class Courses:
    """Inputs that go straight from knot to knot.

    Attributes
    ----------
    times : ndarray, shape (k,)
    values : Mapping of str to ndarray, shape (k,)
    held : frozenset of str
        Those that keep the value of a knot until the next one.
    """

    times: np.ndarray
    values: Mapping[str, np.ndarray]
    held: frozenset[str] = frozenset()

    def at(self, name: str, times: np.ndarray) -> np.ndarray:
        """Return an input at some times."""
        if name in self.held:
            place = np.searchsorted(self.times, np.asarray(times) + 1e-9, side="right") - 1
            return self.values[name][place]
        return np.interp(times, self.times, self.values[name])

    def slope(self, name: str, start: float, end: float) -> float:
        """Return the slope of an input between two times without a knot between them."""
        if name in self.held:
            return 0.0
        return float(self.at(name, end) - self.at(name, start)) / (end - start)

    def text(self, name: str) -> str:
        """Return an input as an expression of time."""
        values = [float(v) for v in self.values[name]]
        parts = []
        for k in range(len(values) - 1):
            start, end = float(self.times[k]), float(self.times[k + 1])
            slope = (values[k + 1] - values[k]) / (end - start)
            if name in self.held:  # of type Boolean
                parts.append((end, "true" if values[k] else "false"))
            else:
                parts.append((end, f"({values[k]!r} + ({slope!r}) * (time - {start!r}))"))
        whole = parts[-1][1]
        for end, part in reversed(parts[:-1]):
            whole = f"if time < {end!r} then {part} else {whole}"
        return whole


def simulate_fmu(path: Path, courses: Courses, times: np.ndarray) -> dict[str, np.ndarray]:
    """Simulate an FMU in co-simulation by fmpy, with the slopes of its inputs.

    Parameters
    ----------
    path : Path
    courses : Courses
    times : ndarray, shape (n,)
        Communication points from 0, the knots among them.

    Returns
    -------
    dict of str to ndarray
        Outputs, as they are before a sample at the same time.
    """
    description = fmpy.read_model_description(path)
    variables = {v.name: v for v in description.modelVariables}
    reals = [name for name in courses.values if variables[name].type == "Real"]
    outputs = [v for v in description.modelVariables if v.causality == "output"]
    folder = fmpy.extract(path)
    fmu = FMU2Slave(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
    )
    rows = []
    try:
        fmu.instantiate()
        fmu.setupExperiment(tolerance=1e-10, startTime=0.0)
        fmu.enterInitializationMode()
        for k, time in enumerate(times):
            ahead = times[k + 1] if k + 1 < len(times) else time + 1.0
            for name in courses.values:
                reference = [variables[name].valueReference]
                value = courses.at(name, time)
                if name in reals:
                    fmu.setReal(reference, [float(value)])
                else:
                    fmu.setBoolean(reference, [bool(value)])
            if k == 0:
                fmu.exitInitializationMode()
            if reals:
                slopes = [courses.slope(name, time, ahead) for name in reals]
                references = [variables[n].valueReference for n in reals]
                fmu.setRealInputDerivatives(references, [1] * len(reals), slopes)
            rows.append([_value(fmu, v) for v in outputs])
            if k + 1 < len(times):
                fmu.doStep(time, ahead - time)
        fmu.terminate()
    finally:
        fmu.freeInstance()
        shutil.rmtree(folder)
    return dict(zip([v.name for v in outputs], np.array(rows).T, strict=True))


def _value(fmu: FMU2Slave, v: Any) -> float:
    get = fmu.getReal if v.type == "Real" else fmu.getBoolean
    return float(get([v.valueReference])[0])


# --- systems of FMUs -----------------------------------------------------------------------------


def extrapolated(
    system: System,
    inputs: Mapping[str, tuple[np.ndarray, np.ndarray]],
    shown: Sequence[str],
    stop: float,
    points: int,
    compared: int,
) -> dict[str, np.ndarray]:
    """Return what runs by the master tend to as the distance of points goes to zero.

    Its error is a series in their distance, so that three distances, each half of the one before,
    take the first two terms of it away (Romberg).

    Parameters
    ----------
    system : System
    inputs : Mapping of str to tuple of ndarray
        Times and values of knots, with straight lines between them.
    shown : sequence of str
    stop : float
    points : int
        Of the coarsest run, which all samples are at.
    compared : int
        Distances between the points that are returned.

    Returns
    -------
    dict of str to ndarray, shape (compared + 1,)
    """
    results = []
    for count in (points, 2 * points, 4 * points):
        time = np.linspace(0.0, stop, count + 1)
        middle = time + 0.5 * stop / count  # the integral of what is held is that of what moves
        values = {name: np.interp(middle, *course) for name, course in inputs.items()}
        run = master.run(system, time, values, record=shown, method="jacobi")
        assert run.complete
        results.append({name: run.signals[name][:: count // compared] for name in shown})
    coarse, medium, fine = results
    return {name: (8.0 * fine[name] - 6.0 * medium[name] + coarse[name]) / 3.0 for name in shown}


def assert_same(
    simulated: Mapping[str, Any], wanted: Mapping[str, np.ndarray], places: Any, still: Any = ()
) -> None:
    """Assert that variables agree to a millionth at some places, and move except some."""
    for name, values in wanted.items():
        difference = np.abs(np.asarray(simulated[name], dtype=float)[places] - values).max()
        assert name in still or np.ptp(values) > 0.0, f"{name} does not move"
        assert difference <= 1e-6 * np.abs(values).max(), name


# --- rumoca --------------------------------------------------------------------------------------


def simulate_by_rumoca(
    folder: Path,
    texts: Sequence[str],
    model: str,
    stop: float,
    step: float,
    tolerance: float = 1e-9,
) -> dict[str, np.ndarray]:
    """Simulate a model that is written into `texts`, beside the package in a folder.

    By the explicit solver: after an event the interpolant of the other one, BDF, misses the state
    that it begins at by more than the tolerance, upon which rumoca 0.10.2 ends the simulation.

    Returns
    -------
    dict of str to ndarray
        Variables, and ``time``, where an instant of an event is there twice.
    """
    session = rumoca.Session(roots=[str(folder)])
    compiled = session.loads("\n".join(texts), model=model)
    settings = rumoca.SimConfig(dt=step, rtol=tolerance, atol=tolerance * 1e-3, solver="rk45")
    result = compiled.simulate(t=(0.0, stop), config=settings)
    return {"time": np.array(result.time)} | {n: np.array(result[n]) for n in result.names}


# --- pymoca --------------------------------------------------------------------------------------


# pymoca 0.12 loses a connector that is one number
_TYPES = """\
package PpyRig
  package Interfaces
    type RealInput = input Real;
    type RealOutput = output Real;
    type IntegerInput = input Integer;
    type IntegerOutput = output Integer;
    type BooleanInput = input Boolean;
    type BooleanOutput = output Boolean;
  end Interfaces;
end PpyRig;
"""


def parse_by_pymoca(files: Mapping[str, bytes], texts: Sequence[str] = ()) -> pymoca.ast.Tree:
    """Return the syntax tree of a package's files and of further texts, in pymoca's order.

    The first definition of a class counts: signals are types.
    """
    modelica = sorted(path for path in files if path.endswith(".mo") and "Resources" not in path)
    tree = None
    for text in [_TYPES, *(files[path].decode() for path in modelica), *texts]:
        parsed = pymoca.parser.parse(text)
        assert parsed is not None, text
        if tree is None:
            tree = parsed
        else:
            tree.extend(parsed)
    return tree


def flatten_by_pymoca(tree: pymoca.ast.Tree, model: str) -> Any:
    """Return the flat class of a model."""
    reference = pymoca.ast.ComponentRef.from_string(model)
    return pymoca.tree.flatten(tree, reference).classes[model]


def simulate_by_pymoca(
    tree: pymoca.ast.Tree,
    model: str,
    courses: Courses,
    times: np.ndarray,
    forced: Mapping[str, str] | None = None,
) -> dict[str, np.ndarray]:
    """Integrate the equations that pymoca gives to CasADi, by an explicit method of SciPy.

    Parameters
    ----------
    tree : pymoca.ast.Tree
    model : str
        With the courses as its inputs.
    courses : Courses
    times : ndarray, shape (n,)
        Ascending from 0, the knots among them.
    forced : Mapping of str to str, optional
        States that follow an input: no compiler of higher index is at hand.

    Returns
    -------
    dict of str to ndarray
    """
    made = generate(tree, model)
    forced = forced or {}
    names = [v.symbol.name() for v in made.inputs]
    free = [v for v in made.states if v.symbol.name() not in forced]
    solved, unknown = causalised(made, forced)
    state = _start_values(made, free)
    rows = []
    for start, end in zip(courses.times, courses.times[1:], strict=False):
        grid = times[(times > start - 1e-12) & (times < end + 1e-12)].clip(start, end)
        first = np.array([courses.at(name, start) for name in names], dtype=float)
        slope = np.array([courses.slope(name, start, end) for name in names])
        origin = first - slope * start
        path = np.zeros((0, len(grid)))
        if free:
            result = scipy.integrate.solve_ivp(
                lambda t, x, u, du: solved(t, u + du * t, du, x)[: len(x)].full().ravel(),
                (start, end),
                state,
                "DOP853",
                grid,
                args=(origin, slope),
                rtol=1e-11,
                atol=1e-13,
            )
            assert result.success, result.message
            path = result.y
            state = path[:, -1]
        for t, x in zip(grid, path.T, strict=True):
            rest = solved(t, origin + slope * t, slope, x).full().ravel()
            rows.append(np.concatenate([[t], x, rest]))
    table = np.array(rows)
    _, places = np.unique(table[:, 0], return_index=True)
    shown = ["time", *(v.symbol.name() for v in free), *unknown]
    return dict(zip(shown, table[places].T, strict=True))


def _start_values(made: Any, states: Sequence[Any]) -> np.ndarray:
    symbols = [v.symbol for v in made.parameters]
    starts = ca.Function("start", symbols, [ca.vertcat(ca.MX(0, 1), *(v.start for v in states))])
    return starts.call([float(v.value) for v in made.parameters])[0].full().ravel()


def causalised(made: Any, forced: Mapping[str, str]) -> tuple[ca.Function, list[str]]:
    """Return rates and all other unknowns from time, inputs, their slopes and free states.

    One equation after the other is solved that has one unknown left and is linear in it.
    """
    inputs = [v.symbol for v in made.inputs]
    slopes = {u.name(): ca.MX.sym(f"slope of {u.name()}") for u in inputs}
    free, unknown, followed, constraints = [], [], [], []
    for state, rate in zip(made.states, made.der_states, strict=True):
        source = forced.get(state.symbol.name())
        if source is None:
            free.append(state.symbol)
            unknown.append(rate.symbol)
        else:
            followed += [rate.symbol, state.symbol]
            constraints.append(rate.symbol - slopes[source])
    unknown += [*followed, *(v.symbol for v in made.alg_states)]
    parameters = [v.symbol for v in made.parameters]
    columns = [
        ca.vertcat(ca.MX(0, 1), *group)
        for group in ([made.time], inputs, slopes.values(), free, unknown, parameters)
    ]
    residuals = ca.Function("r", columns, [ca.vertcat(*made.equations, *constraints)]).expand()
    symbols = [ca.SX.sym("s", column.numel()) for column in columns[:-1]]
    *known, z = symbols
    residual = residuals(*symbols, [float(v.value) for v in made.parameters])
    values = _solved(residual, z)
    return ca.Function("solved", known, [values]), [s.name() for s in unknown]


def _solved(residual: ca.SX, z: ca.SX) -> ca.SX:
    """Solve equations for their unknowns, each of which is written by what is known."""
    left: dict[int, set[int]] = {row: set() for row in range(residual.numel())}
    for row, column in zip(*ca.jacobian_sparsity(residual, z).get_triplet(), strict=True):
        left[row].add(column)
    done: dict[int, ca.SX] = {}
    while left:
        row, place = _next_solvable(residual, z, left, done)
        known = [(z[k], done[k]) for k in left.pop(row) if k in done]
        equation = residual[row]
        if known:
            symbols, values = zip(*known, strict=True)
            equation = ca.substitute(equation, ca.vertcat(*symbols), ca.vertcat(*values))
        at_zero = ca.substitute(equation, z[place], 0.0)
        done[place] = -at_zero / ca.jacobian(equation, z[place])
    return ca.vertcat(*(done[k] for k in range(z.numel())))


def _next_solvable(
    residual: ca.SX, z: ca.SX, left: Mapping[int, set[int]], done: Mapping[int, ca.SX]
) -> tuple[int, int]:
    """Return an equation with one unknown left, in which it is linear, and that unknown."""
    for row, columns in left.items():
        rest = columns - done.keys()
        if len(rest) == 1 and _is_linear(residual[row], z[min(rest)]):
            return row, min(rest)
    raise AssertionError(f"{len(left)} equations have to be solved together")


def _is_linear(equation: ca.SX, symbol: ca.SX) -> bool:
    return not ca.depends_on(ca.jacobian(equation, symbol), symbol)
