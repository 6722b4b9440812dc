"""From members that are open to a system that is initialized: start values go from outputs to inputs."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fmus.kit.errors import UserError
from orchestration.fmu.instance import Fmu
from orchestration.master.executor import Executor
from orchestration.master.instances import Instance


def enter(members: Sequence[Instance], start: float, stop: float) -> None:
    """Set the parameters of all members and enter their initialization mode.

    Raises
    ------
    UserError
        If a member refuses.
    """
    for member in members:
        _named(member, lambda fmu: fmu.enter_initialization(start, stop))


def initialize(executor: Executor) -> list[str]:
    """Pass start values on until they no longer change, and end the initialization; what should be known of it.

    Raises
    ------
    UserError
        If a member refuses.
    """
    notes = []
    for _ in range(len(executor.members) + 2):
        before = executor.inputs.values.copy()
        _propagate(executor)
        settled = np.isclose(before, executor.inputs.values, rtol=1e-9, atol=1e-12)
        if settled.all():
            break
    else:
        unsettled = ", ".join(str(port) for port, i in executor.inputs.at.items() if not settled[i])
        notes.append(
            f"start values depend on each other in a circle and do not settle: {unsettled}"
        )
    _leave(executor)
    executor.read_early()
    return notes


def _propagate(executor: Executor) -> None:
    try:
        executor.read_early()
        executor.exchange(executor.complete.stages, 0)
    except UserError:
        _leave(executor)  # parameters are judged at the end, and bad ones are the likelier reason
        raise


def _leave(executor: Executor) -> None:
    for member in executor.members:
        _named(member, lambda fmu: fmu.exit_initialization())


def _named(member: Instance, act: Callable[[Fmu], None]) -> None:
    try:
        act(member.fmu)
    except UserError as error:
        raise UserError(f"{member.name}: {error}") from error
