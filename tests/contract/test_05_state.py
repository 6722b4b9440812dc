"""Line 5: the saved state is the whole state; going on from it gives the same bits anywhere."""

from __future__ import annotations

import itertools
import struct
from ctypes import byref, c_void_p
from pathlib import Path

import numpy as np
import pytest

from fmus import COMPONENTS
from fmus.kit.build.building import RUNTIMES
from fmus.kit.component import Component
from tests.contract import checks
from tests.contract.checks import STEPS
from tests.contract.models import Oscillator, Sampler
from tests.contract.raw import ERROR, OK, Instance, Library, doubles, instance, integers, unzipped
from tests.contract.schedule import continuation, go, schedule
from tests.contract.subjects import TELLING, each_component
from tests.support import hosts
from tests.support.pace import slow_but

KINDS = [(kind, runtime) for kind in (*COMPONENTS, Sampler, Oscillator) for runtime in RUNTIMES]
BESIDE = [(cls, runtime) for cls in (Sampler, Oscillator) for runtime in RUNTIMES]


def named(value: str | type) -> str:
    return value if isinstance(value, str) else value.name


# Each component, and models that have discrete states or make the integrator change its step
each_model = pytest.mark.parametrize(
    ("kind", "runtime"),
    slow_but(KINDS, *((name, "native") for name in COMPONENTS), *TELLING, *BESIDE),
    ids=named,
)
# The same where it is about what all states have in common
each_kind = pytest.mark.parametrize(
    ("kind", "runtime"), slow_but(KINDS, *TELLING, *BESIDE), ids=named
)


@pytest.fixture
def model(kind: str | type[Component], runtime: str, fmu, built) -> Path:
    """Path of its FMU."""
    return fmu(kind, runtime) if isinstance(kind, str) else built(kind, runtime)


@each_model
def test_going_on_from_a_saved_state_gives_the_same_bits(model):
    checks.going_on_from_a_saved_state_gives_the_same_bits(model)


@each_kind
def test_a_state_may_be_restored_in_any_mode_and_in_another_instance(model):
    checks.a_state_may_be_restored_anywhere(model)


@each_component
def test_restoring_brings_the_parameters_back_too(archive, subject):
    """An instance that has calculated with other parameters must not keep anything of them."""
    with unzipped(archive) as folder:
        library = Library(folder)
        with Instance(library) as one, Instance(library, b"another") as other:
            one.initialize(subject.parameters)
            other.initialize()
            go(other, schedule(library, 1, STEPS))
            moves, state = schedule(library, 2, STEPS), one.save()
            assert continuation(other, state, 0.0, moves) == go(one, moves)
            one.forget(state)


@each_kind
def test_a_snapshot_that_is_reused_holds_the_newer_state(model):
    with instance(model) as one:
        one.initialize()
        state = one.save()
        address = state.value
        go(one, schedule(one.library, 1, STEPS))
        one.do("fmi2GetFMUstate", byref(state))
        assert state.value == address
        moves, time = schedule(one.library, 2, STEPS), one.time
        first = go(one, moves)
        assert continuation(one, state, time, moves) == first
        one.forget(state)


@each_kind
def test_a_state_begins_with_a_pointer_that_may_be_freed(model):
    """As by fmusim, which takes the state for a pointer to one."""
    with instance(model) as one:
        one.initialize()
        go(one, schedule(one.library, 1, STEPS))
        saved, time = one.save(), one.time
        restored = one.deserialize(one.serialize(saved))
        moves, trails = schedule(one.library, 2, STEPS), [go(one, schedule(one.library, 2, STEPS))]
        for state in (saved, restored):
            assert c_void_p.from_address(state.value).value is None
            trails.append(continuation(one, state, time, moves))
            one.forget(state)
    assert trails[0] == trails[1] == trails[2]


@each_model
def test_a_state_serialized_by_a_former_version_is_refused(model):
    """States began with the word that is now the second: eight bytes less."""
    with instance(model) as one:
        one.initialize()
        block = one.serialize(one.save())
        words = list(struct.unpack_from("=4Q", block))
        assert (words[0], words[3]) == (0, len(block))
        former = struct.pack("=3Q", words[1], words[2], len(block) - 8) + block[32:]
        padded = former + bytes(8)
        state = c_void_p()
        for given in (former, padded, b"\1" + block[1:]):
            one.messages.clear()
            assert one.call("fmi2DeSerializeFMUstate", given, len(given), byref(state)) == ERROR
            (message,) = one.messages
            assert "not a state of" in message
        assert state.value is None
        one.do("fmi2DeSerializeFMUstate", block, len(block), byref(state))
        one.forget(state)


def resume(fmu: str, block: bytes, time: float, seed: int) -> bytes:
    """Go on from a serialized state, in the process of a host that was started again."""
    with instance(fmu) as one:
        state = one.deserialize(block)
        trail = continuation(one, state, time, schedule(one.library, seed, STEPS))
        one.forget(state)
        return trail


@pytest.mark.parametrize(
    ("kind", "runtime"),
    slow_but(
        KINDS, *((kind, runtime) for kind in ("ppy_actuator", Sampler) for runtime in RUNTIMES)
    ),
    ids=named,
)
def test_a_serialized_state_goes_on_in_another_process(model):
    with instance(model) as one:
        one.initialize()
        go(one, schedule(one.library, 1, STEPS))
        state, time = one.save(), one.time
        block = one.serialize(state)
        assert one.serialize(one.deserialize(block)) == block
        one.forget(state)
        expected = go(one, schedule(one.library, 2, STEPS))
    assert hosts.in_subprocess(resume, str(model), block, time, 2) == (0, expected)


@each_model
def test_equal_states_are_equal_bytes(model):
    with unzipped(model) as folder:
        library, blocks = Library(folder), []
        for _ in range(2):
            with Instance(library) as one:
                one.initialize()
                go(one, schedule(library, 3, STEPS))
                blocks.append(one.serialize(one.save()))
    assert blocks[0] == blocks[1]


@each_component
@pytest.mark.parametrize("mode", ["before", "during"])
def test_state_saved_before_the_simulation_starts(one, subject, mode):
    one.do("fmi2SetupExperiment", 0, 0.0, 0.0, 1, 100.0)
    one.set(subject.parameters)
    if mode == "during":
        one.do("fmi2EnterInitializationMode")
    state = one.save()
    trails = []
    for change in (None, 0.9):
        if change is not None:
            one.restore(state)
        if mode == "before":
            one.do("fmi2EnterInitializationMode")
        one.do("fmi2ExitInitializationMode")
        one.time = 0.0
        trails.append(go(one, schedule(one.library, 4, 5)))
        assert one.call("fmi2DoStep", one.time, 200.0, 1) != OK, (
            "the stop time is part of the state"
        )
    assert trails[0] == trails[1]
    one.forget(state)


def test_slopes_of_inputs_are_part_of_the_state(fmu, name, subject):
    with instance(fmu(name, "native")) as one:
        one.initialize()
        one.do(
            "fmi2SetRealInputDerivatives",
            one.references([subject.first]),
            1,
            integers(1),
            doubles(0.7),
        )
        state, found = one.save(), []
        for _ in range(2):
            one.restore(state)
            one.time = 0.0
            one.step(0.5)
            found.append(one.everything())
        one.restore(state)
        one.do(
            "fmi2SetRealInputDerivatives",
            one.references([subject.first]),
            1,
            integers(1),
            doubles(0.0),
        )
        one.time = 0.0
        one.step(0.5)
        found.append(one.everything())
        one.forget(state)
    assert found[0] == found[1] != found[2]


@each_kind
def test_many_states_can_be_kept_and_mixed(model):
    with instance(model) as one:
        one.initialize()
        kept = []
        moves = schedule(one.library, 5, 20)
        for size, values in moves:
            kept.append((one.save(), one.time))
            one.set(values)
            one.step(size)
            kept[-1] += (one.everything(),)
        order = np.random.default_rng(0).permutation(len(kept))
        for k in itertools.chain(order, order[::-1]):
            state, time, expected = kept[k]
            one.restore(state)
            one.time = time
            one.set(moves[k][1])
            one.step(moves[k][0])
            assert one.everything() == expected
        for state, *_ in kept:
            one.forget(state)
