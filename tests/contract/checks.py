"""Checks of the contract that need nothing but an FMU, of a component or of a diagnosis."""

from __future__ import annotations

import math
import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy

from tests.contract.raw import ERROR, Instance, Library, instance, unzipped
from tests.contract.schedule import continuation, go, schedule
from tests.contract.subjects import Subject

STEPS = 20


def library_knows_the_guid_of_the_description(archive: Path) -> None:
    """And no other."""
    with unzipped(archive) as folder:
        library = Library(folder)
        with Instance(library) as right:
            assert right.component is not None
        with Instance(library, guid=b"{00000000-0000-0000-0000-000000000000}") as wrong:
            assert wrong.component is None
            assert library.guid in wrong.messages[0]


def no_time_and_no_order_of_this_machine(archive: Path) -> None:
    """Check that an archive is the same wherever and whenever it is made."""
    with zipfile.ZipFile(archive) as opened:
        entries = opened.infolist()
    assert {entry.date_time for entry in entries} == {(1980, 1, 1, 0, 0, 0)}
    names = [entry.filename for entry in entries]
    assert names == ["modelDescription.xml", *sorted(set(names) - {"modelDescription.xml"})]


def going_on_from_a_saved_state_gives_the_same_bits(archive: Path) -> None:
    """As often as one likes."""
    with instance(archive) as one:
        one.initialize()
        go(one, schedule(one.library, 1, STEPS))
        moves, state, time = schedule(one.library, 2, STEPS), one.save(), one.time
        first = go(one, moves)
        assert continuation(one, state, time, moves) == first
        assert continuation(one, state, time, moves) == first, "restoring does not use the state up"
        one.forget(state)


def a_state_may_be_restored_anywhere(archive: Path) -> None:
    """In any mode, and in another instance."""
    with unzipped(archive) as folder:
        library = Library(folder)
        with Instance(library) as one, Instance(library, b"another") as other:
            one.initialize()
            go(one, schedule(library, 1, STEPS))
            moves, state, time = schedule(library, 2, STEPS), one.save(), one.time
            first = go(one, moves)
            assert continuation(other, state, time, moves) == first, (
                "into an instance that was never initialized"
            )
            for spoil in ("fmi2Terminate", "fmi2Reset"):
                other.do(spoil)
                assert continuation(other, state, time, moves) == first
            one.forget(state)


def _run(one: Instance, subject: Subject) -> bytes:
    one.initialize(subject.parameters)
    return go(one, schedule(one.library, 7, STEPS))


def stepping(one: Instance, subject: Subject) -> None:
    """Bring an instance into the middle of another simulation."""
    one.do("fmi2SetupExperiment", 1, 1e-11, 5.0, 1, 9e9)
    one.set({**subject.parameters, **subject.inputs})
    one.do("fmi2EnterInitializationMode")
    one.do("fmi2ExitInitializationMode")
    one.time = 5.0
    go(one, schedule(one.library, 8, STEPS))


def terminated(one: Instance, subject: Subject) -> None:
    """Bring an instance to the end of another simulation."""
    stepping(one, subject)
    one.do("fmi2Terminate")


def reset_then_run_is_a_fresh_run(
    archive: Path, subject: Subject, spoil: Callable[[Instance, Subject], None] = terminated
) -> None:
    """Whatever was done with the instance before."""
    with unzipped(archive) as folder:
        library = Library(folder)
        with Instance(library) as fresh:
            blank = fresh.serialize(fresh.save())
            expected = _run(fresh, subject)
        with Instance(library) as one:
            spoil(one, subject)
            one.do("fmi2Reset")
            assert one.serialize(one.save()) == blank
            assert _run(one, subject) == expected


def ranges(archive) -> list[tuple[str, str, float, float]]:
    """Return name, unit in messages, minimum and maximum of every parameter with a bound."""
    found = []
    for v in fmpy.read_model_description(str(archive), validate=False).modelVariables:
        if v.causality == "parameter" and (v.min is not None or v.max is not None):
            low, high = (
                math.inf * sign if text is None else float(text)
                for text, sign in ((v.min, -1), (v.max, 1))
            )
            found.append((v.name, "" if v.unit in (None, "1") else f" {told(v.unit)}", low, high))
    return found


def told(unit: str) -> str:
    """Return a unit as messages have it.

    That is ``N*m`` and ``ohm``, where the description has Modelica's ``N.m`` and ``Ohm``.
    """
    unit = re.sub(r"/\((.*)\)", lambda found: "/" + found[1].replace(".", "/"), unit)
    return re.sub(r"(?<=[A-Za-z])(?=\d)", "^", unit).replace(".", "*").replace("Ohm", "ohm")


def beyond(bound: float, sign: int, kind: str) -> float:
    """Value next to a bound, on the side that the sign tells."""
    return bound + sign * (1.0 if kind == "Integer" else 1e-6 * abs(bound) or 1e-9)


def refused(one: Instance, values: dict[str, float]) -> list[str]:
    """Return the messages of an initialization that must fail, and then succeed."""
    one.do("fmi2Reset")
    one.messages.clear()
    one.do("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
    one.do("fmi2EnterInitializationMode")
    before = dict(zip(values, one.get(*values), strict=True))
    one.set(values)
    assert one.call("fmi2ExitInitializationMode") == ERROR
    one.set(before)
    one.do("fmi2ExitInitializationMode")
    one.time = 0.0
    one.step(0.1)
    return one.messages


def every_bound_of_every_parameter_holds(archive: Path) -> None:
    """Check that a value beyond a bound is refused by name, value and range."""
    checked = 0
    with instance(archive) as one:
        for name, unit, low, high in ranges(archive):
            for bound, sign in ((low, -1), (high, 1)):
                if not math.isfinite(bound):
                    continue
                value = beyond(bound, sign, one.variables[name][1])
                messages = refused(one, {name: value})
                assert len(messages) == 1, name
                assert f"parameter '{name}' = {value:.10g}{unit}" in messages[0]
                assert f"is outside its range [{low:.10g}, {high:.10g}]{unit}" in messages[0]
                checked += 1
    assert checked >= 10
