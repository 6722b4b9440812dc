"""Calls that a host should not make, each to fresh instances in a process of its own.

Nothing here may crash. A case gets an initialized instance that has made one step, does its worst,
and returns the statuses of its calls.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from ctypes import byref, c_double, c_size_t, c_void_p
from typing import Any

from tests.contract.raw import Instance, Library, doubles, instance, integers, references, unzipped
from tests.contract.subjects import Subject

Case = Callable[[Instance, Subject], Any]
CASES: dict[str, Case] = {}
CREATING: dict[str, Callable[[Library], Instance]] = {}
NAN, INF = math.nan, math.inf
# What the first message must tell, <role> standing for a variable of the subject. Every status must
# be Error.
EXPECTED = {
    "nan_input": r"fmi2SetReal: '<first>' = -?nan is not a finite number",
    "infinite_input": r"fmi2SetReal: '<first>' = inf is not a finite number",
    "one_bad_value_among_good_ones": r"'<second>' = -?nan is not a finite number",
    "setting_an_output": r"'<output>' is calculated and cannot be set",
    "setting_a_parameter_after_initialization": (
        r"parameter '\w+' cannot be set after initialization"
    ),
    "unknown_value_reference": (
        r"fmi2GetReal: value reference \d+ does not exist; the last one is \d+"
    ),
    "wrong_type": r"fmi2GetInteger: value reference \d+ is '<first>', which is of type Real",
    "text_variables": r"has no String variables",
    "null_arrays": r"fmi2GetReal: an array is NULL though it should have 1 elements",
    "negative_step": r"fmi2DoStep: .* step -0.1 s must be finite numbers, the step positive",
    "zero_step": r"fmi2DoStep: .* step 0 s must be finite numbers, the step positive",
    "nan_step": r"fmi2DoStep: .* step -?nan s must be finite",
    "infinite_step": r"fmi2DoStep: .* step inf s must be finite",
    "invisibly_small_step": r"a step of 1e-300 s cannot be represented at t = 0.1 s",
    "step_from_another_time": r"the step begins at 77.1 s but the instance is at 0.1 s",
    "step_beyond_the_stop_time": r"the step ends at 1.1 s, after the stop time 1 s",
    "initializing_again": r"fmi2SetupExperiment is not allowed between steps",
    "using_what_is_not_initialized": r"fmi2DoStep is not allowed before initialization",
    "using_what_is_terminated": r"fmi2DoStep is not allowed after termination",
    "cancelling_a_step": r"steps are never pending",
    "bad_experiment": r"start time -?nan is not a finite number",
    "nothing_where_something_is_needed": r"parameter '<positive>' = 0( \S+)? is outside its range",
    "nan_parameter": r"'<parameter>' = -?nan is not a finite number",
    "null_state": r"fmi2GetFMUstate: a pointer is NULL",
    "broken_serialized_state": (
        r"fmi2DeSerializeFMUstate: \d+ bytes are not a state of \w+, which has \d+"
    ),
    "wrong_directions": r"fmi2GetDirectionalDerivative",
    "wrong_slopes": r"fmi2SetRealInputDerivatives",
    "slopes_of_outputs": r"fmi2GetRealOutputDerivatives is not supported",
    "enormous_input": r"",
}


def case(function: Case) -> Case:
    CASES[function.__name__] = function
    return function


def creating(function: Callable[[Library], Instance]) -> Callable[[Library], Instance]:
    CREATING[function.__name__] = function
    return function


def put(one: Instance, name: str, value: float) -> int:
    return one.call("fmi2SetReal", one.references([name]), 1, doubles(value))


# --- values
# --------------------------------------------------------------------------------------------------


@case
def nan_input(one, subject):
    return [put(one, subject.first, NAN), put(one, subject.second, NAN)]


@case
def infinite_input(one, subject):
    return [put(one, subject.first, INF), put(one, subject.second, -INF)]


@case
def one_bad_value_among_good_ones(one, subject):
    before = one.get(subject.first)
    status = one.call(
        "fmi2SetReal", one.references([subject.first, subject.second]), 2, doubles(3.0, NAN)
    )
    assert one.get(subject.first) == before, "nothing is written unless everything is valid"
    return [status]


@case
def setting_an_output(one, subject):
    calculated = [
        n
        for n, c in one.library.causality.items()
        if c in ("output", "local") and one.variables[n][1] == "Real"
    ]
    return [put(one, name, 1.0) for name in (subject.output, *calculated)]


@case
def setting_a_parameter_after_initialization(one, subject):
    fixed = [
        name
        for name, variability in one.library.variability.items()
        if variability == "fixed" and one.variables[name][1] == "Real"
    ]
    return [put(one, name, 1.0) for name in fixed]


@case
def enormous_input(one, subject):
    # Finite, and so accepted; what follows overflows.
    put(one, subject.first, 1e308)
    put(one, subject.second, 1e308)
    statuses = [one.call("fmi2DoStep", one.time, 0.1, 1)]
    cell = doubles(0.0)
    for name, (_, kind) in one.variables.items():
        one.call(f"fmi2Get{kind}", one.references([name]), 1, cell)
    return statuses


# --- references and arrays
# ------------------------------------------------------------------------------------------


@case
def unknown_value_reference(one, subject):
    cell = doubles(0.0)
    return [
        one.call(f"fmi2{verb}Real", references(number), 1, cell)
        for verb in ("Get", "Set")
        for number in (len(one.variables), 2**31, 2**32 - 1)
    ]


@case
def wrong_type(one, subject):
    cell = integers(1)
    return [
        one.call(f"fmi2{verb}{kind}", one.references([subject.first]), 1, cell)
        for verb in ("Get", "Set")
        for kind in ("Integer", "Boolean")
    ]


@case
def text_variables(one, subject):
    cell = (ctypes.c_char_p * 1)(b"text")
    return [
        one.call("fmi2GetString", references(0), 1, cell),
        one.call("fmi2SetString", references(0), 1, cell),
    ]


@case
def null_arrays(one, subject):
    calls = [
        one.call(f"fmi2{verb}{kind}", *arguments)
        for verb in ("Get", "Set")
        for kind in ("Real", "Integer", "Boolean")
        for arguments in ((None, 1, doubles(0.0)), (references(0), 1, None), (None, 2**40, None))
    ]
    return [*calls, one.call("fmi2SetDebugLogging", 1, 3, None)]


# --- steps
# --------------------------------------------------------------------------------------------------


@case
def negative_step(one, subject):
    return [one.call("fmi2DoStep", one.time, -0.1, 1)]


@case
def zero_step(one, subject):
    return [one.call("fmi2DoStep", one.time, 0.0, 1)]


@case
def nan_step(one, subject):
    return [one.call("fmi2DoStep", one.time, NAN, 1), one.call("fmi2DoStep", NAN, 0.1, 1)]


@case
def infinite_step(one, subject):
    return [one.call("fmi2DoStep", one.time, INF, 1), one.call("fmi2DoStep", INF, 0.1, 1)]


@case
def invisibly_small_step(one, subject):
    return [one.call("fmi2DoStep", one.time, 1e-300, 1)]


@case
def step_from_another_time(one, subject):
    return [
        one.call("fmi2DoStep", one.time + 77.0, 0.1, 1),
        one.call("fmi2DoStep", one.time - 0.05, 0.1, 1),
    ]


@case
def step_beyond_the_stop_time(one, subject):
    one.do("fmi2Reset")
    one.do("fmi2SetupExperiment", 0, 0.0, 0.0, 1, 1.0)
    one.do("fmi2EnterInitializationMode")
    one.do("fmi2ExitInitializationMode")
    one.time = 0.0
    return [one.call("fmi2DoStep", 0.0, 1.1, 1)]


# --- order
# --------------------------------------------------------------------------------------------------


@case
def initializing_again(one, subject):
    return [
        one.call("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0),
        one.call("fmi2EnterInitializationMode"),
        one.call("fmi2ExitInitializationMode"),
    ]


@case
def using_what_is_not_initialized(one, subject):
    one.do("fmi2Reset")
    cell = doubles(0.0)
    statuses = [
        one.call("fmi2DoStep", 0.0, 0.1, 1),
        one.call("fmi2GetReal", references(0), 1, cell),
        one.call("fmi2ExitInitializationMode"),
        one.call("fmi2Terminate"),
    ]
    one.initialize()
    return statuses


@case
def using_what_is_terminated(one, subject):
    one.do("fmi2Terminate")
    statuses = [
        one.call("fmi2DoStep", one.time, 0.1, 1),
        put(one, subject.first, 1.0),
        one.call("fmi2Terminate"),
        one.call("fmi2EnterInitializationMode"),
    ]
    one.get(subject.output)  # reading is allowed
    one.do("fmi2Reset")
    one.initialize()
    return statuses


@case
def cancelling_a_step(one, subject):
    return [one.call("fmi2CancelStep")]


@case
def bad_experiment(one, subject):
    one.do("fmi2Reset")
    statuses = [
        one.call("fmi2SetupExperiment", 0, 0.0, NAN, 0, 0.0),
        one.call("fmi2SetupExperiment", 0, 0.0, 1.0, 1, 1.0),
        one.call("fmi2SetupExperiment", 0, 0.0, 0.0, 1, NAN),
        one.call("fmi2SetupExperiment", 1, -1.0, 0.0, 0, 0.0),
        one.call("fmi2SetupExperiment", 1, NAN, 0.0, 0, 0.0),
    ]
    one.initialize()
    return statuses


# --- parameters
# --------------------------------------------------------------------------------------------------


@case
def nothing_where_something_is_needed(one, subject):
    one.do("fmi2Reset")
    one.do("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
    one.do("fmi2EnterInitializationMode")
    (before,) = one.get(subject.positive)
    one.set({subject.positive: 0.0})
    status = one.call("fmi2ExitInitializationMode")
    one.set({subject.positive: before})
    one.do("fmi2ExitInitializationMode")
    one.time = 0.0
    return [status]


@case
def nan_parameter(one, subject):
    one.do("fmi2Reset")
    status = put(one, subject.parameter, NAN)
    one.initialize()
    return [status]


# --- state
# --------------------------------------------------------------------------------------------------


@case
def null_state(one, subject):
    nothing, size = c_void_p(), c_size_t()
    return [
        one.call("fmi2GetFMUstate", None),
        one.call("fmi2SetFMUstate", None),
        one.call("fmi2SerializedFMUstateSize", None, byref(size)),
        one.call("fmi2SerializeFMUstate", None, None, 0),
        one.call("fmi2DeSerializeFMUstate", None, 10, byref(nothing)),
        one.call("fmi2DeSerializeFMUstate", b"0123456789", 10, None),
    ]


@case
def broken_serialized_state(one, subject):
    state = one.save()
    block = one.serialize(state)
    statuses = []
    for spoiled in (
        block[:-1],
        block + b"\0",
        bytes(len(block)),
        b"\xff" * len(block),
        b"",
        block[:100] + bytes([block[100] ^ 1]) + block[101:],
        bytes([block[0] ^ 1]) + block[1:],
    ):
        target = c_void_p()
        statuses.append(one.call("fmi2DeSerializeFMUstate", spoiled, len(spoiled), byref(target)))
        assert not target.value
    short = ctypes.create_string_buffer(len(block) - 1)
    statuses.append(one.call("fmi2SerializeFMUstate", state, short, len(short)))
    one.forget(state)
    return statuses


# --- derivatives
# --------------------------------------------------------------------------------------------------


@case
def wrong_directions(one, subject):
    output, fed, cell = (
        one.references([subject.output]),
        one.references([subject.first]),
        doubles(0.0),
    )
    return [
        one.call("fmi2GetDirectionalDerivative", *arguments)
        for arguments in (
            (None, 1, fed, 1, doubles(1.0), cell),
            (output, 1, None, 1, doubles(1.0), cell),
            (output, 1, fed, 1, None, cell),
            (output, 1, fed, 1, doubles(1.0), None),
            (references(999), 1, fed, 1, doubles(1.0), cell),
            (output, 1, references(2**32 - 1), 1, doubles(1.0), cell),
            (output, 1, fed, 1, doubles(NAN), cell),
            (fed, 1, output, 1, doubles(1.0), cell),
            (output, 1, one.references([subject.parameter]), 1, doubles(1.0), cell),
        )
    ]


@case
def wrong_slopes(one, subject):
    fed = one.references([subject.first])
    return [
        one.call("fmi2SetRealInputDerivatives", *arguments)
        for arguments in (
            (None, 1, integers(1), doubles(1.0)),
            (fed, 1, None, doubles(1.0)),
            (fed, 1, integers(1), None),
            (fed, 1, integers(2), doubles(1.0)),
            (fed, 1, integers(0), doubles(1.0)),
            (fed, 1, integers(1), doubles(NAN)),
            (one.references([subject.output]), 1, integers(1), doubles(1.0)),
            (references(2**32 - 1), 1, integers(1), doubles(1.0)),
        )
    ]


@case
def slopes_of_outputs(one, subject):
    return [
        one.call(
            "fmi2GetRealOutputDerivatives",
            one.references([subject.output]),
            1,
            integers(1),
            doubles(0.0),
        )
    ]


# --- creating
# --------------------------------------------------------------------------------------------------


@creating
def without_a_name(library):
    return Instance(library, None)


@creating
def with_an_empty_name(library):
    return Instance(library, b"")


@creating
def of_another_kind(library):
    return Instance(library, kind=7)


@creating
def with_another_guid(library):
    return Instance(library, guid=b"{%s%n}")


@creating
def without_a_guid(library):
    return Instance(library, guid=None)


@creating
def without_callbacks(library):
    return Instance(library, callbacks=None)


@creating
def without_resources(library):
    return Instance(library, resources=None)


@creating
def with_missing_resources(library):
    return Instance(library, resources=b"file:///no/such%20folder/100%/resources")


# --- in the process
# -------------------------------------------------------------------------------------------------


def play(fmu: str, subject: Subject) -> dict[str, tuple[Any, list[str], list[int]]]:
    """Make every case; each ends with a step, which shows that the instance still works."""
    answers: dict[str, tuple[Any, list[str], list[int]]] = {}
    with unzipped(fmu) as folder:
        library = Library(folder)
        for name, hostile in CASES.items():
            print(name, flush=True)  # the last name is the case that crashed
            with Instance(library, b"100 %s %n") as one:
                one.initialize()
                one.step(0.1)
                statuses = hostile(one, subject)
                answers[name] = (statuses, list(one.messages), list(one.levels))
                if name == "enormous_input":
                    one.do("fmi2Reset")
                    one.initialize()
                one.step(0.1)
        for name, create in CREATING.items():
            print(name, flush=True)
            with create(library) as created:
                answers[name] = (created.component is None, created.messages, created.levels)
    return answers


def call_without_an_instance(fmu: str) -> dict[str, int]:
    """Status of every function that is given NULL for the instance."""
    cell = (c_double * 4)()
    with unzipped(fmu) as folder:
        library = Library(folder)
        for function in ("fmi2GetTypesPlatform", "fmi2GetVersion"):
            getattr(library.dll, function).restype = ctypes.c_char_p
            assert getattr(library.dll, function)() in (b"default", b"2.0")
        arguments: dict[type, Any] = {c_size_t: 1, c_void_p: cell, c_double: 0.1, ctypes.c_int: 1}
        statuses = {}
        for name, function in vars(library.dll).items():
            if name.startswith("fmi2") and name not in (
                "fmi2Instantiate",
                "fmi2FreeInstance",
                "fmi2GetVersion",
                "fmi2GetTypesPlatform",
            ):
                print(name, flush=True)
                statuses[name] = function(
                    None, *(arguments[kind] for kind in function.argtypes[1:])
                )
        library.dll.fmi2FreeInstance(None)
    return statuses


def without_a_logger(fmu: str, fed: str) -> list[int]:
    """Errors of an instance whose host has no logger."""
    with unzipped(fmu) as folder:
        library = Library(folder)
        nothing = (c_void_p * 5)()
        with Instance(library, callbacks=byref(nothing)) as one:
            one.initialize()
            statuses = [one.call("fmi2DoStep", 0.0, -1.0, 1), put(one, fed, NAN)]
            one.step(0.1)
    return statuses


def foreign_state(fmu: str, other: str) -> tuple[list[int], list[str]]:
    """Statuses of giving one FMU the state of another."""
    with instance(fmu) as one, instance(other) as two:
        one.initialize()
        two.initialize()
        state = two.save()
        block, target = two.serialize(state), c_void_p()
        statuses = [one.call("fmi2SetFMUstate", state)]
        statuses.append(one.call("fmi2DeSerializeFMUstate", block, len(block), byref(target)))
        two.forget(state)
        one.step(0.1)
        return statuses, one.messages


def meet_a_bug(fmu: str) -> dict[str, Any]:
    """Run into a law that raises or is not a number: in a step, on reading, in initialization."""
    with unzipped(fmu) as folder, Instance(Library(folder)) as one:
        one.initialize({"current": 0.9})
        for _ in range(3):
            one.step(0.1)
        before = dict(zip(one.variables, one.everything(), strict=True))
        one.set({"current": 6.0})
        statuses = {"step": one.call("fmi2DoStep", one.time, 0.1, 1)}
        text = one.messages[-1]
        statuses |= {
            "step again": one.call("fmi2DoStep", one.time, 0.1, 1),
            "set": put(one, "current", 0.9),
            "states": one.call("fmi2GetReal", one.references(["charge"]), 1, kept := doubles(NAN)),
        }
        cell = doubles(NAN)
        one.call("fmi2GetReal", one.references(["voltage"]), 1, cell)
        one.call("fmi2GetReal", one.references(["der(kelvin_elongation)"]), 1, cell)
        time = c_double(NAN)
        statuses["last time"] = one.call("fmi2GetRealStatus", 2, byref(time))
        statuses["reset"] = one.call("fmi2Reset")
        one.do("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
        one.set({"current": 6.0})
        one.do("fmi2EnterInitializationMode")
        statuses["initialize"] = one.call("fmi2ExitInitializationMode")
        at_start = one.messages[-1]
        statuses["reset again"] = one.call("fmi2Reset")
        one.initialize({"current": 0.9})
        for _ in range(3):
            one.step(0.1)
        after = dict(zip(one.variables, one.everything(), strict=True))
        statuses["terminate"] = one.call("fmi2Terminate")
        return {
            "statuses": statuses,
            "message": text,
            "at start": at_start,
            "same": before == after,
            "charge kept": kept[0] == before["charge"],
            "time": time.value,
            "levels": one.levels,
        }


def run_away(fmu: str) -> tuple[int, str, float]:
    """Integrate dx/dt = x^2 from x = 1 over its pole at 1 s."""
    with unzipped(fmu) as folder, Instance(Library(folder)) as one:
        one.initialize({"growth": 1.0})
        one.step(0.5)
        status = one.call("fmi2DoStep", one.time, 1.0, 1)
        value = one.get("runaway")[0]
        return status, one.messages[-1], value
