"""How much a process grows under each kind of use; measured in a process that has little else in it."""

from __future__ import annotations

from tests.contract.raw import ERROR, Instance, Library, fast_stepper, instance, resident, unzipped
from tests.contract.subjects import Subject

WARM_UP = 20_000  # steps before memory is measured


def grow_by_creating(fmu: str, warm_up: int, cycles: int) -> int:
    """Bytes by which create/free cycles make the process grow."""
    with unzipped(fmu) as folder:
        library = Library(folder)
        model = Instance(library)  # its callbacks serve all
        create, free = library.dll.fmi2Instantiate, library.dll.fmi2FreeInstance
        guid, resources = library.guid.encode(), library.resources

        def cycle(count: int) -> None:
            for _ in range(count):
                free(create(b"instance", 1, guid, resources, model.callbacks, 0, 0))

        cycle(warm_up)
        before = resident()
        cycle(cycles)
        grown = resident() - before
        model.free()
        return grown


def grow_by_stepping(fmu: str, subject: Subject, steps: int) -> tuple[int, float, float]:
    """Bytes by which steps make the process grow, the time reached, and the size of the steps."""
    with instance(fmu) as one:
        one.initialize()
        size = 0.1 * one.library.step
        advance = fast_stepper(one, subject.first, 0.1 * subject.inputs[subject.first], subject.output)
        advance(WARM_UP, size)
        before = resident()
        advance(steps, size)
        return resident() - before, one.time, size


def grow_by_everything_else(fmu: str, broken: str) -> int:
    """Bytes by which states, resets, refusals and failed steps make the process grow."""
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

        cycle(3000)
        before = resident()
        cycle(3000)
        return resident() - before
