"""The procedure of a commissioning: a table of checks, each of one protection of the rig.

A check begins with a rig that is driven at its targets, and leaves it in any state: the rig is
released before the next one. A check that the safe state did not follow ends the procedure.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, suppress
from datetime import datetime
from functools import partial
from math import inf
from time import monotonic
from typing import NamedTuple

from fmus.kit import UserError
from fmus.rig_proxy import NOT_REACHED, RUNNING, LinkError
from orchestration.plugins.commission.protocol import (
    FAILED,
    INTERRUPTED,
    NOT_APPLICABLE,
    NOT_CONFIRMED,
    PASS,
    Finding,
    Line,
    Protocol,
)
from orchestration.plugins.commission.served import OBSERVATION, ServedRig
from orchestration.rig import operator

_BEYOND = 1e-3  # of a range, by which a command is beyond a limit
_REPLACED = 5.0  # s in which another standby has to be started
_IMPORTS = 5.0  # s that it takes to be ready, on a busy machine
_HELD = 1.0  # s for which an acknowledgement has to be without effect
_OPENS = 60.0  # s that an operator has to open or close an interlock
_WRONG = "0" * 16  # name of no latch
_SAFE = "the safe state within {bound:.3g} s, confirmed, latched"


class Check(NamedTuple):
    """A check of one protection.

    Attributes
    ----------
    title, action, requirement : str
        What it is of, what is done, and what must hold; ``{bound}`` is the bound of the server, s.
    run : callable
        Takes the rig, and returns what was measured; UserError if the protection has failed.
    """

    title: str
    action: str
    requirement: str
    run: Callable[[ServedRig], str]


def _limits(rig: ServedRig) -> str:
    """Command beyond each limit; a refused set of commands changes no value."""
    begun = len(rig.rows)
    taken = []
    for name, limit in rig.limits.items():
        margin = _BEYOND * (limit["max"] - limit["min"])
        for value in (limit["min"] - margin, limit["max"] + margin):
            if rig.exchange({**rig.targets, name: value}):
                taken.append(rig.describe({name: value}))
            rig.turn()
    number = len(rig.limits)
    rig.wait(lambda: len(rig.rows) > begun + number, 1.0)
    moved = ""
    for row in rig.rows[begun:]:
        for values in (row.applied, row.read_back):
            moved = moved or rig.deviations(values, rig.targets)
    if taken or moved:
        raise UserError(f"not refused: {taken or 'none'}; moved to: {moved or 'none'}")
    return f"{2 * number} of {2 * number} refused, nothing moved"


def _rates(rig: ServedRig) -> str:
    """Measure the mean rate of the ramp to the targets, and command a jump back."""
    texts = []
    verdict = PASS
    for name, limit in rig.limits.items():
        rate = limit["rate"]
        if rate == inf:
            continue
        change = abs(rig.targets[name] - rig.rest[name])
        took = rig.ramp(name)
        is_taken = rig.exchange({**rig.targets, name: rig.rest[name]})
        unit = f"{rig.inputs[name]}/s"
        jump = "not refused" if is_taken else "refused"
        texts.append(f"{name} {change / took:.4g} {unit} of {rate:.4g} {unit}; the jump is {jump}")
        # both ends of the ramp are known to a sample
        longest = took + 2.0 * rig.status["period"]
        if is_taken:
            longest = min(longest, rig.status["watchdog"])
        if change > rate * longest:
            verdict = FAILED
        elif is_taken and verdict == PASS:
            texts.append("it is as small as one that is allowed; try a larger --level")
            verdict = NOT_CONFIRMED
    if not texts:
        return rig.found(NOT_APPLICABLE, "no input has a limit of its rate")
    return rig.found(verdict, "; ".join(texts))


def _stop(rig: ServedRig, latch: str = "") -> str:
    """Stop as an operator does."""
    fault = monotonic()
    operator.ask(rig.remote, "stop", reason="commissioning")
    return rig.wait_safe(fault, latch)


def _second_stop(rig: ServedRig) -> str:
    """Stop a rig that is safe: it is another latch, whose safe state is confirmed anew."""
    _stop(rig)
    return _stop(rig, rig.status["latch"])


def _silence(rig: ServedRig) -> str:
    """Send nothing any more."""
    rig.turn()
    rig.drives = False
    return rig.wait_safe(monotonic())


def _release(rig: ServedRig) -> str:
    """Try to go on after a stop by all ways that must not work."""
    _stop(rig)
    faults = []
    with suppress(UserError):
        operator.ask(rig.remote, "acknowledge", latch=_WRONG)
        faults.append("another name released it")
    with suppress(LinkError):
        if rig.exchange(rig.targets):
            faults.append("a command was taken")
    with suppress(LinkError), closing(rig.link(**rig.inputs)) as newcomer:
        newcomer.connect(0.0, 1.0)
        faults.append("a session was accepted")
    operator.acknowledge(rig.remote, rig.status["latch"])
    with suppress(LinkError):
        rig.exchange(rig.targets)
        faults.append("the session went on after the acknowledgement")
    if faults:
        raise UserError(f"not kept: {', '.join(faults)}")
    return (
        "refused: another name, a command, a session before the release, the old session after it"
    )


def _fault(rig: ServedRig, role: str, act: str) -> str:
    """Kill or stop a process of the server."""
    process = rig.processes()[role]
    fault = monotonic()
    getattr(process, act)()
    return rig.wait_safe(fault)


def _standby(rig: ServedRig) -> str:
    """Kill the standby: the rig goes on, and another one is there when the guard is killed."""
    killed = rig.processes()["standby"]
    rig.marks = ((monotonic(), "fault"),)
    first = len(rig.rows)
    killed.kill()
    is_replaced = rig.wait(
        lambda: rig.processes().get("standby", killed).pid != killed.pid, _REPLACED
    )
    rig.wait(lambda: False, _IMPORTS)
    states = {row.state for row in rig.rows[first:]} - {RUNNING}
    if states or not is_replaced:
        raise UserError(", ".join(states) or f"no other standby within {_REPLACED:g} s")
    return f"running until the guard was killed; {_fault(rig, 'guard', 'kill')}"


def _interlock(rig: ServedRig, name: str) -> str:
    """Let the operator open an interlock and close it."""
    ask = f"Can you open {name} now? There are {_OPENS:g} s from your answer on."
    if not rig.ask(ask):
        return rig.found(NOT_CONFIRMED, "nobody opened it")
    rig.release()  # the rig waits for commands no longer than its watchdog time
    rig.begin()
    if not rig.wait(lambda: bool(rig.status["latch"]), _OPENS):
        raise UserError(f"no latch within {_OPENS:g} s")
    reason = rig.status["reason"]
    measured = rig.wait_safe(monotonic())  # when it opened, nobody knows
    if name not in reason:
        raise UserError(f"{reason}; {measured}")
    reached = 1e3 * (rig.status["reached"] or 0.0)
    with suppress(UserError):  # it is latched anew
        operator.acknowledge(rig.remote, rig.status["latch"], _HELD)
    rig.turn()
    if not rig.status["latch"]:
        raise UserError("it was released while it was open")
    if not rig.ask(f"Now close {name} again. Is it closed?"):
        return rig.found(NOT_CONFIRMED, "nobody closed it")
    return f"safe {reached:.0f} ms after the latch; not released while it was open"


def _heartbeat(rig: ServedRig) -> str:
    """Ask whether the relay has dropped that watches the heartbeat."""
    if not rig.device.has_heartbeat:
        return rig.found(NOT_APPLICABLE, "the backend has no heartbeat")
    measured = _fault(rig, "device", "suspend")
    verdict = rig.answer("Has the relay dropped out that watches the heartbeat?")
    return rig.found(verdict, f"dropped out: {verdict}; {measured}")


def _front(rig: ServedRig) -> str:
    """Kill the front; read the device before anybody writes to it, and start the server again."""
    fault = monotonic()
    rig.marks = ((fault, "fault"),)
    if not rig.kill_front():
        raise UserError("processes of the server are left")
    ended = f"all processes ended after {monotonic() - fault:.2f} s"
    read = rig.read_device()
    rig.start()
    if differing := rig.deviations(read, rig.rest):
        raise UserError(f"left with {differing}")
    latched = "the next server is latched" if rig.device.names else "no device, so no latch is kept"
    if rig.device.names and not rig.status["latch"]:
        raise UserError("the next server is not latched")
    if not read:
        return rig.found(NOT_CONFIRMED, f"{ended}; {latched}; the device does not say it")
    return f"{ended}; read back: {rig.describe(read)}; {latched}"


CHECKS = (
    Check(
        "Limits",
        "each input is commanded beyond each of its limits",
        "every command is refused, and nothing moves",
        _limits,
    ),
    Check(
        "Rates",
        "each input with a limit of its rate is commanded to its level by a ramp, and back at once",
        "it moves no faster, and the jump is refused",
        _rates,
    ),
    Check("Stop", "an operator stops the rig", _SAFE, _stop),
    Check(
        "Second stop",
        "an operator stops the rig that is safe",
        "another latch, and the safe state confirmed anew within {bound:.3g} s",
        _second_stop,
    ),
    Check("Silent client", "the client sends nothing any more", _SAFE, _silence),
    Check(
        "Release",
        "after a stop: an acknowledgement of another name, a command, another session, and the"
        " session of before when the rig was released",
        "each is refused",
        _release,
    ),
    Check(
        "Device killed", "its process is killed", _SAFE, partial(_fault, role="device", act="kill")
    ),
    Check(
        "Guard killed", "its process is killed", _SAFE, partial(_fault, role="guard", act="kill")
    ),
    Check(
        "Standby killed",
        f"its process is killed, and that of the guard {_IMPORTS:g} s later",
        f"the rig goes on; another stands by: {_SAFE}",
        _standby,
    ),
    Check(
        "Device hangs",
        "its process is stopped",
        _SAFE,
        partial(_fault, role="device", act="suspend"),
    ),
    Check("Heartbeat", "the device's process is stopped", "the relay drops out", _heartbeat),
    Check(
        "Front killed",
        "its process is killed, and the server is started again",
        "all processes end, the device reports its values at rest before that, the server is"
        " latched",
        _front,
    ),
)


def checks_of(rig: ServedRig) -> Iterator[Check]:
    """Yield the checks of a rig: those of all rigs, and one for each of its interlocks.

    An interlock is an output without a unit that has limits.
    """
    *before, front = CHECKS
    yield from before
    units = rig.status["outputs"]
    action = "the operator opens it and tries to release the rig"
    requirement = f"{_SAFE}, and no release while it is open"
    interlocks = [name for name in rig.status["limits"] if units.get(name) == "1"]
    for name in interlocks:
        run = partial(_interlock, name=name)
        yield Check(f"Interlock {name}", action, requirement, run)
    if not interlocks:
        none = "no output without a unit has limits"
        run = partial(ServedRig.found, verdict=NOT_APPLICABLE, measured=none)
        yield Check("Interlocks", action, requirement, run)
    yield front


def commission(
    rig: ServedRig, tell: Callable[[Line], None], checks: Sequence[Check] = ()
) -> Protocol:
    """Try every protection of a rig, one after the other, and end its server.

    Parameters
    ----------
    rig : ServedRig
        Not driven yet.
    tell : callable
        Called with each line.
    checks : sequence of Check, optional
        By default all.

    Returns
    -------
    Protocol
        Of what was done, also if it was interrupted.
    """
    lines: list[Line] = []
    interrupted = ""
    try:
        for check in checks or checks_of(rig):
            lines.append(_tried(rig, check))
            tell(lines[-1])
            if rig.status["state"] == NOT_REACHED:
                raise UserError("the safe state was not reached, so that nothing more is driven")
        rig.release()
    except KeyboardInterrupt:
        interrupted = INTERRUPTED
    except UserError as error:
        interrupted = str(error)
    status = rig.close()
    if status and not interrupted:
        interrupted = f"the server ended with exit status {status}"
    return Protocol(_facts(rig), rig.inputs, tuple(lines), tuple(rig.log), interrupted)


def _tried(rig: ServedRig, check: Check) -> Line:
    """Return the line of a check; one that cannot be carried out has failed."""
    rig.release()
    rig.begin()
    try:
        measured = check.run(rig)
    except UserError as error:
        rig.verdict, measured = FAILED, str(error)
    finding = Finding(rig.verdict, measured, rig.marks)
    requirement = check.requirement.format(bound=rig.bound)
    return Line(check.title, check.action, requirement, finding, tuple(rig.rows))


def _facts(rig: ServedRig) -> dict[str, str]:
    """Return what the protocol is of."""
    device = rig.device
    return {
        "date": datetime.now().isoformat(" ", "seconds"),
        "backend": device.backend,
        **{f"option {name}": value for name, value in device.options.items()},
        "devices": ", ".join(device.names) or "none that is real",
        "served with": " ".join(rig.words),
        "driven to": rig.describe(rig.targets),
        "period": f"{rig.status['period']:.4g} s",
        "watchdog": f"{rig.status['watchdog']:g} s",
        "safe within": f"{rig.bound:.3g} s, and {OBSERVATION:g} s until it is seen here",
        **device.facts,
    }
