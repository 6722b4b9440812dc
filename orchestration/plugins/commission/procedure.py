"""The procedure of a commissioning: a table of checks, each of one protection of the rig.

A check begins with a rig that is driven at its targets, and leaves it in any state: the rig is
released before the next one. A check that the safe state did not follow ends the procedure.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from datetime import datetime
from functools import partial
from importlib.metadata import version
from time import monotonic
from typing import NamedTuple

from fmus.kit import UserError
from fmus.rig_proxy import NOT_REACHED, RUNNING, Link, LinkError
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
        Takes the rig, and returns what was found.
    """

    title: str
    action: str
    requirement: str
    run: Callable[[ServedRig], Finding]


def _limits(rig: ServedRig) -> Finding:
    """Command beyond each limit; a refused set of commands changes no value."""
    begun = len(rig.rows)
    taken = []
    beyond = {name: rig.range_of(name) for name in rig.targets}
    for name, (low, high) in beyond.items():
        margin = _BEYOND * (high - low)
        for value in (low - margin, high + margin):
            sample = rig.exchange({**rig.targets, name: value})
            if sample is None or not sample["refused"]:
                taken.append(rig.describe({name: value}))
            rig.turn()
    rig.drive_until(lambda: len(rig.rows) > begun + len(beyond), 1.0)
    moved = [
        text
        for row in rig.rows[begun:]
        for values in (row.applied, row.read_back)
        if (text := rig.deviations(values, rig.targets))
    ]
    if taken or moved:
        return Finding(FAILED, f"not refused: {taken or 'none'}; moved to: {moved[:1] or 'none'}")
    return Finding(PASS, f"{2 * len(beyond)} of {2 * len(beyond)} refused, nothing moved")


def _rates(rig: ServedRig) -> Finding:
    """Measure the mean rate of the ramp to the targets, and command a jump back."""
    rates = rig.rates()
    if not rates:
        return Finding(NOT_APPLICABLE, "no input has a limit of its rate")
    texts, verdicts = [], []
    for name, rate in rates.items():
        change = abs(rig.targets[name] - rig.rest[name])
        took = rig.ramp(name)
        sample = rig.exchange({**rig.targets, name: rig.rest[name]})
        is_refused = sample is not None and bool(sample["refused"])
        unit = f"{rig.status['inputs'][name]}/s"
        jump = "refused" if is_refused else "not refused"
        texts.append(f"{name} {change / took:.4g} {unit} of {rate:.4g} {unit}; the jump is {jump}")
        # both ends of the ramp are known to a sample
        is_faster = change > rate * (took + 2.0 * rig.status["period"])
        is_taken = not is_refused and change > rate * rig.status["watchdog"]
        if is_faster or is_taken:
            verdicts.append(FAILED)
        elif not is_refused:
            texts.append("it is as small as one that is allowed; try a larger --level")
            verdicts.append(NOT_CONFIRMED)
    return Finding(_worst(verdicts), "; ".join(texts))


def _worst(verdicts: Sequence[str]) -> str:
    """Return the first of FAILED, not confirmed and pass that is among verdicts, or pass."""
    return next((one for one in (FAILED, NOT_CONFIRMED) if one in verdicts), PASS)


def _stop(rig: ServedRig) -> Finding:
    """Stop as an operator does."""
    fault = monotonic()
    operator.ask(rig.remote, "stop", reason="commissioning")
    return rig.wait_safe(fault)


def _second_stop(rig: ServedRig) -> Finding:
    """Stop a rig that is safe: it is another latch, whose safe state is confirmed anew."""
    first = _stop(rig)
    if first.verdict == FAILED:
        return first
    latch = rig.status["latch"]
    fault = monotonic()
    operator.ask(rig.remote, "stop", reason="commissioning, again")
    return rig.wait_safe(fault, latch=latch)


def _silence(rig: ServedRig) -> Finding:
    """Send nothing any more."""
    rig.turn()
    return rig.wait_safe(monotonic(), drives=False)


def _release(rig: ServedRig) -> Finding:
    """Try to go on after a stop by all ways that must not work."""
    finding = _stop(rig)
    if finding.verdict == FAILED:
        return finding
    faults = []
    with suppress(UserError):
        operator.ask(rig.remote, "acknowledge", latch=_WRONG)
        faults.append("another name released it")
    with suppress(LinkError):
        sample = rig.exchange(rig.targets)
        if sample is not None and not sample["refused"]:
            faults.append("a command was taken")
    newcomer = Link(rig.remote.requests, rig.status["inputs"], {}, rig.credentials)
    with suppress(LinkError):
        newcomer.connect(0.0, 1.0)
        faults.append("a session was accepted")
    newcomer.close()
    operator.acknowledge(rig.remote, rig.status["latch"])
    with suppress(LinkError):
        sample = rig.exchange(rig.targets)
        if sample is not None:
            faults.append("the session went on after the acknowledgement")
    refused = "another name, a command, a session before the release, the old session after it"
    text = f"not kept: {', '.join(faults)}" if faults else f"refused: {refused}"
    return finding._replace(verdict=FAILED if faults else finding.verdict, measured=text)


def _fault(rig: ServedRig, role: str, act: str) -> Finding:
    """Kill or stop a process of the server."""
    process = rig.processes()[role]
    fault = monotonic()
    getattr(process, act)()
    return rig.wait_safe(fault)


def _standby(rig: ServedRig) -> Finding:
    """Kill the standby: the rig goes on, and another one is there when the guard is killed."""
    killed = rig.processes()["standby"]
    begun = monotonic()
    first = len(rig.rows)
    killed.kill()
    is_replaced = rig.drive_until(
        lambda: rig.processes().get("standby", killed).pid != killed.pid, _REPLACED
    )
    ready = monotonic() + _IMPORTS
    rig.drive_until(lambda: monotonic() > ready, 2.0 * _IMPORTS)
    states = {row.state for row in rig.rows[first:]} - {RUNNING}
    if states or not is_replaced:
        said = ", ".join(states) or f"no other standby within {_REPLACED:g} s"
        return Finding(FAILED, said, ((begun, "fault"),))
    finding = _fault(rig, "guard", "kill")
    return finding._replace(measured=f"running until the guard was killed; {finding.measured}")


def _interlock(rig: ServedRig, name: str) -> Finding:
    """Let the operator open an interlock and close it."""
    ask = f"Can you open {name} now? There are {_OPENS:g} s from your answer on."
    if not rig.ask(ask):
        return Finding(NOT_CONFIRMED, "nobody opened it")
    rig.release()  # the rig waits for commands no longer than its watchdog time
    rig.begin()
    if not rig.drive_until(lambda: bool(rig.status["latch"]), _OPENS):
        return Finding(FAILED, f"no latch within {_OPENS:g} s")
    reason = rig.status["reason"]
    finding = rig.wait_safe(monotonic())  # when it opened, nobody knows
    if name not in reason or finding.verdict == FAILED:
        return finding._replace(verdict=FAILED, measured=f"{reason}; {finding.measured}")
    reached = rig.status["reached"] or 0.0
    with suppress(UserError):  # it is latched anew
        operator.acknowledge(rig.remote, rig.status["latch"], _HELD)
    if not rig.turn(drives=False)["latch"]:
        return finding._replace(verdict=FAILED, measured="it was released while it was open")
    if not rig.ask(f"Now close {name} again. Is it closed?"):
        return finding._replace(verdict=NOT_CONFIRMED, measured="nobody closed it")
    reached = f"safe {1e3 * reached:.0f} ms after the latch"
    return finding._replace(measured=f"{reached}; not released while it was open")


def _heartbeat(rig: ServedRig) -> Finding:
    """Ask whether the relay has dropped that watches the heartbeat."""
    if not rig.device.has_heartbeat:
        return Finding(NOT_APPLICABLE, "the backend has no heartbeat")
    finding = _fault(rig, "device", "suspend")
    verdict = rig.answer("Has the relay dropped out that watches the heartbeat?")
    text = f"dropped out: {verdict}; {finding.measured}"
    return finding._replace(verdict=FAILED if finding.verdict == FAILED else verdict, measured=text)


def _front(rig: ServedRig) -> Finding:
    """Kill the front; read the device before anybody writes to it, and start the server again."""
    fault = monotonic()
    if not rig.kill_front():
        return Finding(FAILED, "processes of the server are left", ((fault, "fault"),))
    took = monotonic() - fault
    read = rig.read_device()
    rig.start()
    marks = ((fault, "fault"),)
    if differing := rig.deviations(read, rig.rest):
        return Finding(FAILED, f"left with {differing}", marks)
    if rig.device.names and not rig.status["latch"]:
        return Finding(FAILED, "the next server is not latched", marks)
    latched = "the next server is latched" if rig.device.names else "no device, so no latch is kept"
    ended = f"all processes ended after {took:.2f} s"
    if not read:
        return Finding(NOT_CONFIRMED, f"{ended}; {latched}; the device does not say it", marks)
    return Finding(PASS, f"{ended}; read back: {rig.describe(read)}; {latched}", marks)


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
    units = rig.status["outputs"]
    interlocks = [name for name in rig.status["limits"] if units.get(name) == "1"]
    *before, front = CHECKS
    yield from before
    action = "the operator opens it and tries to release the rig"
    requirement = f"{_SAFE}, and no release while it is open"
    for name in interlocks:
        run = partial(_interlock, name=name)
        yield Check(f"Interlock {name}", action, requirement, run)
    if not interlocks:
        none = Finding(NOT_APPLICABLE, "no output without a unit has limits")
        yield Check("Interlocks", action, requirement, lambda rig: none)
    yield front


def commission(
    rig: ServedRig, tell: Callable[[Line], None], checks: Sequence[Check] | None = None
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
    facts = _facts(rig)
    lines: list[Line] = []
    interrupted = ""
    try:
        for check in checks_of(rig) if checks is None else checks:
            line = _tried(rig, check)
            lines.append(line)
            tell(line)
            if rig.status["state"] == NOT_REACHED:
                interrupted = "the safe state was not reached, so that nothing more is driven"
                break
        else:
            rig.release()
    except KeyboardInterrupt:
        interrupted = INTERRUPTED
    except UserError as error:
        interrupted = str(error)
    status = rig.close()
    if status and not interrupted:
        interrupted = f"the server ended with exit status {status}"
    return Protocol(facts, rig.status["inputs"], tuple(lines), tuple(rig.log), interrupted)


def _tried(rig: ServedRig, check: Check) -> Line:
    """Return the line of a check; one that cannot be carried out has failed."""
    rig.release()
    begun = len(rig.rows)
    rig.begin()
    try:
        finding = check.run(rig)
    except UserError as error:
        finding = Finding(FAILED, str(error))
    requirement = check.requirement.format(bound=rig.bound)
    return Line(check.title, check.action, requirement, finding, tuple(rig.rows[begun:]))


def _facts(rig: ServedRig) -> dict[str, str]:
    """Return what the protocol is of."""
    device = rig.device
    options = {f"option {name}": value for name, value in device.options.items()}
    digests = {f"SHA-256 of {name}": digest for name, digest in device.digests.items()}
    return {
        "date": datetime.now().isoformat(" ", "seconds"),
        "ppy-rig": version("ppy-rig"),
        "backend": device.backend,
        **options,
        "devices": ", ".join(device.names) or "none that is real",
        "served with": " ".join(rig.words),
        "driven to": rig.describe(rig.targets),
        "period": f"{rig.status['period']:.4g} s",
        "watchdog": f"{rig.status['watchdog']:g} s",
        "safe within": f"{rig.bound:.3g} s, and {OBSERVATION:g} s until it is seen here",
        **digests,
    }
