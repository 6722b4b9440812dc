"""The state machines of FMI as tables, and the faults of a sequence of calls.

Written from the tables of allowed calls of FMI 2.0.4 (3.2.3 for model exchange, 4.2.4 for
co-simulation) and of the states of FMI 3.0.2 (2.3, 3.2, 4.2), for real variables alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from tests.support.recording import Call, values_read, values_set

NOTHING, INSTANTIATED, INITIALIZATION, EVENT, CONTINUOUS, STEP, DISCARDED, TERMINATED, ERROR = (
    "nothing",
    "Instantiated",
    "Initialization Mode",
    "Event Mode",
    "Continuous-Time Mode",
    "Step Mode",
    "Step Discarded",
    "Terminated",
    "Error",
)
_ALIVE = {INSTANTIATED, INITIALIZATION, EVENT, CONTINUOUS, STEP, DISCARDED, TERMINATED, ERROR}
_RUNNING = {EVENT, CONTINUOUS, STEP, DISCARDED}
_READABLE = {INITIALIZATION, *_RUNNING, TERMINATED}
# function: states in which it may be called
ALLOWED = {
    "Instantiate": {NOTHING},
    "FreeInstance": _ALIVE,
    "Reset": _ALIVE,
    "SetupExperiment": {INSTANTIATED},
    "EnterInitializationMode": {INSTANTIATED},
    "ExitInitializationMode": {INITIALIZATION},
    "Terminate": _RUNNING,
    "GetReal": _READABLE,
    "SetReal": {INSTANTIATED, INITIALIZATION, EVENT, CONTINUOUS, STEP},
    "DoStep": {STEP},
    "GetBooleanStatus": {STEP, DISCARDED, TERMINATED},
    "GetRealStatus": {STEP, DISCARDED, TERMINATED},
    "EnterEventMode": {CONTINUOUS},
    "NewDiscreteStates": {EVENT},
    "EnterContinuousTimeMode": {EVENT},
    "CompletedIntegratorStep": {CONTINUOUS},
    "SetTime": {EVENT, CONTINUOUS},
    "SetContinuousStates": {CONTINUOUS},
    "GetContinuousStates": _READABLE,
    "GetNominalsOfContinuousStates": {EVENT, CONTINUOUS, TERMINATED},
    "GetDerivatives": {EVENT, CONTINUOUS, TERMINATED},
}
# function: the state after it; of the exit from initialization by the interface
_AFTER = {
    "Instantiate": INSTANTIATED,
    "FreeInstance": NOTHING,
    "Reset": INSTANTIATED,
    "EnterInitializationMode": INITIALIZATION,
    "Terminate": TERMINATED,
    "EnterEventMode": EVENT,
    "EnterContinuousTimeMode": CONTINUOUS,
}
# variables that may be set: parameters before initialization ends, inputs from it on
_SETTABLE = {
    INSTANTIATED: {"k", "tau", "keeps", "ends", "fails"},
    INITIALIZATION: {"k", "tau", "keeps", "ends", "fails", "u"},
    EVENT: {"u"},
    CONTINUOUS: {"u"},
    STEP: {"u"},
}


def faults(calls: Sequence[Call], version: int) -> Iterator[str]:
    """Yield what the standard does not allow in the life of an instance."""
    state, settings = NOTHING, {"ends": 1e300, "fails": 1e300}
    interface, now, is_set_up = "", -1e300, False
    for place, (_, _, function, arguments) in enumerate(calls):
        where = f"call {place}, {function} {' '.join(arguments)} in {state}"
        if state not in ALLOWED.get(function, ()):
            yield f"{where}: not allowed"
        state = _AFTER.get(function, state)
        if function == "Instantiate":
            (interface,) = arguments
        elif function == "ExitInitializationMode":
            state = STEP if interface == "CoSimulation" else EVENT
        elif function == "Reset":
            settings, is_set_up = {"ends": 1e300, "fails": 1e300}, False
        elif function == "SetReal":
            given = values_set(calls[place])
            if not given.keys() <= _SETTABLE.get(state, set()):
                yield f"{where}: not settable there"
            settings |= given
        elif function == "GetReal" and state == INITIALIZATION:
            hidden = set(values_read(calls[place])) - {"y", "x", "der(x)"}
            yield from (f"{where}: {name} is not readable there" for name in hidden)
        if function == "SetupExperiment" or (
            version == 3 and function == "EnterInitializationMode"
        ):
            is_set_up = True
            now = float(arguments[2])
        elif function == "EnterInitializationMode" and not is_set_up:
            yield f"{where}: without SetupExperiment"
        if function == "DoStep":
            begin, size = map(float, arguments)
            if abs(begin - now) > 1e-9 * max(1.0, abs(now)):
                yield f"{where}: the last step ended at {now}"
            if not size > 0.0:
                yield f"{where}: no step"
            now = begin + size
            if now > settings["fails"]:
                state = ERROR
            elif now > settings["ends"] + 1e-12:
                state = DISCARDED
    if state != NOTHING:
        yield f"it ends in {state}, without FreeInstance"
    ended = [call.function for call in calls]
    for place, function in enumerate(ended):
        if function in ("Reset", "FreeInstance"):
            before = ended[:place][::-1]
            end = next((f for f in before if f in ("Terminate", "ExitInitializationMode")), None)
            failed = settings["fails"] < 1e300
            if end == "ExitInitializationMode" and not failed:
                yield f"call {place}, {function}: without Terminate"
