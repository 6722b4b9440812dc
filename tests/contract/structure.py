"""Dependencies of a model description, compared with finite differences of its FMU."""

from __future__ import annotations

from pathlib import Path

import fmpy
import numpy as np

from tests.contract.raw import Instance, Library, unzipped

ENOUGH, POINTS = 12, 400
# Shares of a nominal value: what is beyond limits counts too
SIZES = (-10.0, -1.0, 0.1, 1.0, 100.0)
# The length that the spring k1 takes up is k1 * length / k1: a law depends on k1, its value does
# not. A leg falls with its foot, or is held: its acceleration forward does not depend on gravity.
CANCELLED = {("mechanical_displacement", "k1"), ("der(leg_velocity_y)", "gravity")}


def evaluate(library: Library, values: dict[str, float], read: list[str]) -> np.ndarray:
    """Unknowns at the start of a simulation; states have the values of their start parameters."""
    with Instance(library) as one:
        one.do("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
        one.do("fmi2EnterInitializationMode")
        one.set(values)
        return np.array(one.get(*read))


def random_point(rng: np.random.Generator, description) -> dict[str, float]:
    """Draw values of all parameters and inputs near their start values.

    An imposed length makes the actuator taut, or slack; a free foot is in the ground, or above it.
    """
    values = {}
    for v in description.modelVariables:
        if v.causality not in ("parameter", "input"):
            continue
        if v.type == "Boolean":
            values[v.name] = float(rng.integers(2))
            continue
        start, nominal = float(v.start), float(v.nominal or 1.0)
        near = (
            start * rng.uniform(0.8, 1.2)
            if start
            else nominal * rng.uniform(0.2, 2.0) * rng.choice(SIZES)
        )
        low, high = (
            fallback if text is None else float(text)
            for text, fallback in ((v.min, near), (v.max, near))
        )
        values[v.name] = float(round(near) if v.type == "Integer" else min(max(near, low), high))
    if "length_change" in values:
        values["length_change"] = rng.uniform(2e-3, 3e-3) * rng.choice([-1.0, 1.0])
    if "leg_height_start" in values:
        values["leg_height_start"] = rng.uniform(0.0, 0.1)
    return values


def effective_dependencies(
    library: Library, description, expected: dict[str, set[str]], knowns: dict[str, str]
) -> dict[str, set[str]]:
    """Return the knowns that move each unknown at some random point.

    ``knowns`` maps a known to the variable that is set in its place.
    """
    rng, unknowns = np.random.default_rng(1), list(expected)
    moved: dict[str, set[str]] = {name: set() for name in unknowns}
    for count in range(POINTS):
        if count >= ENOUGH and moved == expected:
            break
        point, other = random_point(rng, description), random_point(rng, description)
        before = evaluate(library, point, unknowns)
        for known, variable in knowns.items():
            after = evaluate(library, point | {variable: other[variable]}, unknowns)
            for name, differs in zip(
                unknowns, np.abs(after - before) > 1e-12 * np.abs(before), strict=True
            ):
                if differs:
                    moved[name].add(known)
    return moved


def declared(unknowns) -> dict[str, set[str]]:
    return {u.variable.name: {k.name for k in u.dependencies} for u in unknowns}


def dependencies_are_those_found_by_differences(archive: Path) -> None:
    """No known moves an unknown that does not say so, and none is listed in vain."""
    description = fmpy.read_model_description(str(archive), validate=True)
    states = [u.variable.derivative.name for u in description.derivatives]
    inputs = [v.name for v in description.modelVariables if v.causality == "input"]
    parameters = [v.name for v in description.modelVariables if v.causality == "parameter"]
    knowns = {name: name for name in inputs} | {name: f"{name}_start" for name in states}
    with unzipped(archive) as folder:
        library = Library(Path(folder))
        for listed, set_in_place in (
            (description.outputs, knowns),
            (description.derivatives, knowns),
            (description.initialUnknowns, {name: name for name in (*parameters, *inputs)}),
        ):
            dependencies = declared(listed)
            effective = effective_dependencies(library, description, dependencies, set_in_place)
            for unknown, moving in effective.items():
                spare = dependencies[unknown] - moving
                assert moving <= dependencies[unknown]
                assert not spare or {(unknown, known) for known in spare} <= CANCELLED


def every_unknown_is_listed(archive: Path) -> None:
    """Check that outputs, derivatives and initial unknowns are those that the variables make; where
    no host can derive by a state, FMI has neither it nor its derivative there.
    """
    description = fmpy.read_model_description(str(archive), validate=True)
    can_derive = description.coSimulation.providesDirectionalDerivative
    rates = [v for v in description.modelVariables if v.derivative is not None and can_derive]
    outputs = [v.name for v in description.modelVariables if v.causality == "output"]
    derivatives = [v.name for v in rates]
    states = [v.derivative.name for v in rates]
    assert list(declared(description.outputs)) == outputs
    assert list(declared(description.derivatives)) == derivatives
    assert sorted(declared(description.initialUnknowns)) == sorted(
        {*outputs, *derivatives, *states}
    )
