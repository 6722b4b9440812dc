"""Memory that each kind of use takes and does not give back, counted in a process of its own."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

from tests.contract.raw import (
    ERROR,
    Instance,
    Library,
    allocated,
    fast_stepper,
    instance,
    resident,
    unzipped,
)
from tests.contract.subjects import Subject

WARM_UP = 100  # cycles or steps before memory is counted
WINDOWS = 6  # threads of a messaging library give back late on a busy machine
LEAST = 16  # bytes of the smallest block, of C and of Python


def left_allocated(use: Callable[[int], object], cycles: int) -> int:
    """Return the bytes that repeated use leaves allocated; what settles only once is no leak."""
    use(WARM_UP)
    counts = [allocated()]
    for _ in range(WINDOWS):
        use(cycles)
        counts.append(allocated())
    return min(after - before for before, after in pairwise(counts))


def grow_by_creating(fmu: str, cycles: int) -> int:
    """Bytes that create/free cycles leave allocated."""
    with unzipped(fmu) as folder:
        library = Library(folder)
        model = Instance(library)  # its callbacks serve all
        create, free = library.dll.fmi2Instantiate, library.dll.fmi2FreeInstance
        guid, resources = library.guid.encode(), library.resources

        def cycle(count: int) -> None:
            for _ in range(count):
                free(create(b"instance", 1, guid, resources, model.callbacks, 0, 0))

        grown = left_allocated(cycle, cycles)
        model.free()
        return grown


def grow_by_stepping(fmu: str, subject: Subject, steps: int) -> tuple[int, float]:
    """Bytes that steps leave allocated, and the time reached in steps."""
    with instance(fmu) as one:
        advance, size = stepper(one, subject)
        return left_allocated(lambda count: advance(count, size), steps), one.time / size


def grow_by_many_steps(fmu: str, subject: Subject, steps: int) -> int:
    """Bytes by which steps make the process grow."""
    with instance(fmu) as one:
        advance, size = stepper(one, subject)
        advance(20_000, size)
        before = resident()
        advance(steps, size)
        return resident() - before


def stepper(one: Instance, subject: Subject) -> tuple[Callable[[int, float], None], float]:
    """Start an instance; how to make many steps, and their size."""
    one.initialize()
    value = 0.1 * subject.inputs[subject.first]
    return fast_stepper(one, subject.first, value, subject.output), 0.1 * one.library.step


def grow_by_everything_else(fmu: str, broken: str, cycles: int) -> int:
    """Bytes that states, resets, refusals and failed steps leave allocated."""
    with instance(fmu) as one, instance(broken) as failing:

        def cycle(count: int) -> None:
            for _ in range(count):
                one.initialize({"current": 0.9})
                one.step(0.1)
                state = one.save()
                copy = one.deserialize(one.serialize(state))
                one.restore(copy)
                one.forget(state)
                one.forget(copy)
                one.call("fmi2DoStep", 99.0, 0.1, 1)
                one.do("fmi2Reset")
                failing.initialize()
                failing.set({"current": 6.0})
                assert failing.call("fmi2DoStep", 0.0, 0.1, 1) == ERROR
                failing.do("fmi2Reset")
                one.messages.clear(), one.levels.clear(), one.categories.clear()
                failing.messages.clear(), failing.levels.clear(), failing.categories.clear()

        return left_allocated(cycle, cycles)
