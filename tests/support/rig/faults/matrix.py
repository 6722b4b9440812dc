"""Combinations: processes that are stopped, killed or hang, alone and in pairs, with every signal
of a terminal, while the client does one thing or another.

Judged from outside alone: by what the device was given, which it holds, and by what the client
gets to know.
"""

from __future__ import annotations

import itertools
import os
import random
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path

from fmus.rig_proxy.link import Link, LinkError
from tests.support.rig.driver import INPUTS, OUTPUTS, Driver
from tests.support.rig.exhausted import no_descriptors, no_memory, no_threads
from tests.support.rig.process import ROOT, Call, Server, hil_bench
from tests.support.rig.terminal import HOLD, Terminal
from tests.support.small_disk import disk_of_64_kib

PERIOD = 1 / 30  # s, of the server
TREATMENTS = {
    "front": ("STOP", "KILL"),  # from outside a busy one is a stopped one
    "guard": ("STOP", "KILL"),
    "standby": ("STOP", "KILL"),
    "device": ("STOP", "KILL", "hangs"),
}
SIGNALS = ("HUP", "INT", "QUIT", "TSTP", "TTIN", "TTOU", "USR1", "USR2", "TERM", "WINCH")
ENDING = ("HUP", "INT", "QUIT", "USR1", "TERM")  # what must end in the safe state by itself
CLIENTS = ("idle", "commanding", "recording", "hil_bench")
# what there is none left of; the disk is that of the latch, and nobody takes what is printed
LACKS = ("", "threads", "memory", "descriptors", "disk", "output")
ALARM = 0.5  # s, within which an alarm is promised where only hardware can help
_COMMANDS = [0.8, 1.0]
_STARTS = 5  # of a trial, at most
_SPANS = (0.0, 0.1, 1.0)  # shares of the longest: at once, before and after anybody may notice
_SETTLING = 0.3  # s, of what is let go on again
_EXPERIMENT = """
component = "ppy_actuator"
duration = "60 s"
step = "0.05 s"
record = ["voltage", "displacement"]
inputs = {current = "0.8 A", force = "1 N"}
"""

Faults = tuple[tuple[str, str], ...]  # process and treatment


@dataclass(frozen=True)
class Combination:
    """Events at about the same time.

    Attributes
    ----------
    faults : tuple of (str, str)
        Processes and what is done to them.
    signal : str
        What the foreground gets; empty for none.
    client : str
        What the client does.
    lacks : str
        What no process gets any more.
    """

    faults: Faults
    signal: str
    client: str
    lacks: str = ""

    def __str__(self) -> str:
        events = [f"{process} {how}" for process, how in self.faults]
        events += [f"SIG{self.signal}"] * bool(self.signal)
        return ", ".join([*events, self.client, *([f"no {self.lacks}"] if self.lacks else [])])

    @property
    def kind(self) -> str:
        """Group that it is counted in."""
        processes = " and ".join(process for process, _ in self.faults)
        if self.is_for_hardware:
            return "all processes"
        return processes or f"SIG{self.signal} alone"

    @property
    def demands(self) -> bool:
        """True if the rig must become safe; without its reserve it may serve on."""
        return any(map(_demands, self.faults)) or self.signal in ENDING

    @property
    def is_for_hardware(self) -> bool:
        """True if no process remains that could act."""
        return len(self.faults) == len(TREATMENTS)


@dataclass(frozen=True)
class Outcome:
    """Result of a combination.

    Attributes
    ----------
    combination : Combination
    result : {"safe", "served", "alarm", "BROKEN"}
    seconds : float
        From the last event before it to the safe state, or to the alarm; where it was served, from
        the end of the client.
    exposure : float
        From the first event that demands the safe state, in s.
    bound : float
        What is promised of `seconds`, in s.
    remark : str
        What is broken.
    """

    combination: Combination
    result: str
    seconds: float
    exposure: float
    bound: float
    remark: str = ""


def all_combinations() -> list[Combination]:
    """Every one, in order; those of all processes without a signal."""
    single = [(process, how) for process, ways in TREATMENTS.items() for how in ways]
    faults: list[Faults] = [(), *((one,) for one in single)]
    faults += _of_different_processes(single, 2)
    crossed = [
        Combination(*chosen)
        for chosen in itertools.product(faults, ("", *SIGNALS), CLIENTS)
        if chosen[0] or chosen[1]
    ]
    of_all = itertools.product(_of_different_processes(single, len(TREATMENTS)), CLIENTS)
    return crossed + [Combination(chosen, "", client) for chosen, client in of_all]


def _of_different_processes(single: list[tuple[str, str]], number: int) -> list[Faults]:
    return [
        chosen
        for chosen in itertools.combinations(single, number)
        if len({process for process, _ in chosen}) == number
    ]


def drawn(number: int, seed: int) -> list[Combination]:
    """Draw combinations by chance, and what is lacking in each."""
    chance = random.Random(seed)
    chosen = chance.sample(all_combinations(), number)
    return [replace(combination, lacks=chance.choice(LACKS)) for combination in chosen]


def bound_of(server: Server, watchdog: float) -> float:
    """Time to the safe state that the server promises in its first line, in s."""
    stated = re.search(r"safe within ([\d.]+) s", server.wait_line("ready: "))
    return float(stated[1]) if stated else watchdog + PERIOD + 0.1


def trial(
    combination: Combination,
    folder: Path,
    seed: int,
    watchdog: float = 0.2,
    allowance: float = 0.0,
) -> Outcome:
    """Bring a combination about, and judge what comes of it.

    Parameters
    ----------
    combination : Combination
    folder : Path
        For files; empty.
    seed : int
        Of order and times.
    watchdog : float
        Of the server, in s.
    allowance : float
        Added to the bound, in s, for a machine that has other things to do.

    Returns
    -------
    Outcome
    """
    for number in range(_STARTS):
        place = folder / str(number)
        place.mkdir()
        with ExitStack() as opened:
            try:
                server, client = _started(opened, combination, place, watchdog)
            except AssertionError:  # too busy a machine: the rig was safe before anything happened
                continue
            begun = _Trial(combination, server, client, watchdog, allowance)
            opened.enter_context(_without(combination.lacks, server, place))
            return begun.run(random.Random(seed))
    raise AssertionError(f"too busy a machine: nothing began, {_STARTS} times")


def _started(
    opened: ExitStack, combination: Combination, folder: Path, watchdog: float
) -> tuple[Server, _Idle]:
    """Start a server on a terminal of its own, and the client, if there is one."""
    hang = {"trigger": folder / "trigger", "where": "read", "how": "hang", "times": 1}
    arguments = ["--watchdog", watchdog]
    if combination.lacks == "disk":
        arguments += ["--state", opened.enter_context(disk_of_64_kib(folder / "disk"))]
    kind = _CLIENTS[combination.client]
    server = opened.enter_context(
        Server(folder, kind.backend, *arguments, options=hang, terminal=Terminal())
    )
    server.wait_ready()
    client = kind(server, folder)
    opened.callback(client.close)
    client.start()
    return server, client


@contextmanager
def _without(lacks: str, server: Server, folder: Path) -> Iterator[None]:
    """Let nothing of something be left for a server while the context lasts."""
    if lacks == "disk":
        with suppress(OSError), (folder / "disk" / "filler").open("wb") as file:
            file.write(bytes(2**16))
    elif lacks == "output":
        assert server.terminal is not None
        server.terminal.press(HOLD)
    elif lacks:
        with _REFUSED[lacks](server.family()):
            yield
        return
    yield


_REFUSED = {"threads": no_threads, "memory": no_memory, "descriptors": no_descriptors}


class _Trial:
    def __init__(
        self,
        combination: Combination,
        server: Server,
        client: _Idle,
        watchdog: float,
        allowance: float,
    ) -> None:
        self._combination = combination
        self._server = server
        self._client = client
        self._allowance = allowance
        self._bound = bound_of(server, watchdog)
        self._longest_span = 1.5 * watchdog  # of all events
        self._roles = server.roles()
        self._events: list[float] = []
        self._demand = inf  # the first of them that demands the safe state

    def run(self, chance: random.Random) -> Outcome:
        acts = self._acts()
        chance.shuffle(acts)
        span = self._longest_span * chance.choice(_SPANS)
        times = sorted(chance.uniform(0.0, span) for _ in acts)
        begun = time.monotonic()
        for due, (demands, act) in zip(times, acts, strict=True):
            time.sleep(max(0.0, begun + due - time.monotonic()))
            now = time.monotonic()
            self._events.append(now)
            if demands:
                self._demand = min(self._demand, now)
            with suppress(OSError):  # what it is for has ended by itself
                act()
        longest = ALARM if self._combination.is_for_hardware else self._bound
        time.sleep(longest + self._allowance)
        self._client.insist()
        if not self._combination.demands:
            self._events.append(time.monotonic())  # who tried to command has gone
        if self._is_serving():
            return self._served()
        noticed = self._client.noticed(self._events[0])
        self._let_go_on()
        return self._judged(noticed)

    def _acts(self) -> list[tuple[bool, Callable[[], object]]]:
        """Return acts, each with whether it demands the safe state."""
        faults = self._combination.faults
        acts = [(_demands(fault), self._act(*fault)) for fault in faults]
        name = self._combination.signal
        if name:
            number = signal.Signals[f"SIG{name}"]
            acts.append((name in ENDING, lambda: self._server.send(number)))
        return acts

    def _act(self, process: str, how: str) -> Callable[[], object]:
        if how == "hangs":
            return self._server.trigger.touch
        return lambda: os.kill(self._roles[process], signal.Signals[f"SIG{how}"])

    def _let_go_on(self) -> None:
        """Nothing may be commanded by what was stopped and goes on."""
        for process in self._server.family():
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGCONT)
        time.sleep(_SETTLING)

    def _is_serving(self) -> bool:
        """Return True if nothing had to come of the events, and commands are carried out."""
        if self._combination.demands:
            return False
        written = _last_command(self._server.calls())
        return written is not None and time.monotonic() - written < 2 * PERIOD + self._allowance

    def _served(self) -> Outcome:
        """The watchdog must work as before."""
        self._demand = time.monotonic()
        self._events = [self._demand]
        self._client.vanish()
        time.sleep(self._bound + self._allowance)
        outcome = self._judged(None)
        return outcome if outcome.result == "BROKEN" else replace(outcome, result="served")

    def _judged(self, noticed: float | None) -> Outcome:
        calls = self._server.calls()
        last = _last_command(calls)
        if last is None:
            return self._outcome("safe", 0.0)
        if self._combination.client == "idle" and self._combination.demands:
            return self._outcome(
                "BROKEN", 0.0, "a command was carried out by a rig that had failed"
            )
        safe = next((call.time for call in calls if call.what == "safe" and call.time > last), inf)
        if safe == inf:
            return self._held(noticed, "the output was held")
        events = [event for event in self._begun(calls) if event < safe]
        took = safe - max(events) if events else 0.0
        if took < self._bound + self._allowance:
            return self._outcome("safe", took, exposure=max(0.0, safe - self._demand))
        return self._held(noticed, f"safe after {took:.3f} s")

    def _begun(self, calls: list[Call]) -> list[float]:
        """Return the times of events; a call that never returns hangs from when it was called."""
        return [*self._events, *(call.time for call in calls if call.what.startswith("fault"))]

    def _held(self, noticed: float | None, remark: str) -> Outcome:
        held = time.monotonic() - self._events[-1]
        if not self._combination.is_for_hardware:
            return self._outcome("BROKEN", held, remark)
        if noticed is None or noticed - self._events[-1] > ALARM + self._allowance:
            return self._outcome("BROKEN", held, f"{remark}, without an alarm of the client")
        return self._outcome("alarm", max(0.0, noticed - self._events[-1]))

    def _outcome(
        self, result: str, seconds: float, remark: str = "", exposure: float = 0.0
    ) -> Outcome:
        bound = ALARM if result == "alarm" else self._bound
        return Outcome(self._combination, result, seconds, exposure, bound, remark)


def _demands(fault: tuple[str, str]) -> bool:
    """Return True if a fault of a process demands the safe state."""
    return fault[0] != "standby"


def _last_command(calls: list[Call]) -> float | None:
    """Return the time at which the output was last given something else than zero, or None."""
    times = [
        call.time
        for call in calls
        if call.what.startswith("write") and any(map(float, call.what.split()[1:]))
    ]
    return times[-1] if times else None


class _Idle:
    """No client, until something has failed; then one that tries to command."""

    backend = "Faulty"

    def __init__(self, server: Server, folder: Path) -> None:
        self._server = server

    def start(self) -> None:
        """Begin to command."""

    def insist(self) -> None:
        """Command, if that is possible."""
        link = Link(self._server.endpoint, INPUTS, OUTPUTS)
        with suppress(LinkError):
            link.connect(0.0, 0.2)
            for number in range(5):
                link.exchange(_COMMANDS, 0.02 * number, 0.02, 0.05)
        link.close()

    def vanish(self) -> None:
        """End without a word."""

    def noticed(self, since: float) -> float | None:
        """Return the time after another at which it learnt that the rig is not there, or None."""
        return None

    def close(self) -> None:
        """Let go of everything."""


class _Commanding(_Idle):
    """Commands every 20 ms, and connects again and again if the session is lost."""

    def __init__(self, server: Server, folder: Path) -> None:
        self._driver = Driver(server.endpoint, lambda number: _COMMANDS, reconnect=True)

    def start(self) -> None:
        self._driver.start()

    def insist(self) -> None:
        """It does all the time."""

    def vanish(self) -> None:
        self._driver.hang()

    def noticed(self, since: float) -> float | None:
        return next((when for when in self._driver.silences if when > since), None)

    def close(self) -> None:
        self._driver.stop(orderly=False)


class _Recording(_Idle):
    """``ppy rig record``, as a process of its own."""

    first = "write 0.8"

    def __init__(self, server: Server, folder: Path) -> None:
        self._process = subprocess.Popen(
            self._command(server.endpoint, folder),
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._lines: list[tuple[float, str]] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self._server = server

    def _command(self, endpoint: str, folder: Path) -> list[str]:
        (folder / "experiment.toml").write_text(_EXPERIMENT)
        command = [sys.executable, "-m", "orchestration.cli", "rig", "record"]
        command += ["--stimulus", "experiment.toml", "--out", "record.csv"]
        return [*command, "--endpoint", endpoint]

    def start(self) -> None:
        self._server.wait_call(self.first, 0.0)

    def _read(self) -> None:
        assert self._process.stderr is not None
        for line in self._process.stderr:
            self._lines.append((time.monotonic(), line))

    def insist(self) -> None:
        """It commands as long as it is served."""

    def vanish(self) -> None:
        self._process.kill()

    def noticed(self, since: float) -> float | None:
        alarms = (
            when
            for when, line in self._lines
            if when > since and line.startswith(("ALARM: ", "error: "))
        )
        return next(alarms, None)

    def close(self) -> None:
        self._process.kill()
        self._process.wait(10.0)
        self._reader.join(5.0)
        assert self._process.stderr is not None
        self._process.stderr.close()


class _Running(_Recording):
    """``ppy run hil_bench --real-time``, whose bench is in a loop with the device."""

    backend = "Actuator"
    first = "write 0.4"

    def _command(self, endpoint: str, folder: Path) -> list[str]:
        return hil_bench(endpoint, 60.0)


_CLIENTS: dict[str, type[_Idle]] = {
    "idle": _Idle,
    "commanding": _Commanding,
    "recording": _Recording,
    "hil_bench": _Running,
}


def try_combinations(
    combinations: list[Combination], folder: Path, tell: Callable[[str], None], seed: int
) -> Iterator[Outcome]:
    """Try one after another, each with times by a seed of its own."""
    for number, combination in enumerate(combinations):
        place = folder / f"combination-{number}"
        place.mkdir()
        outcome = trial(combination, place, seed + number)
        tell(
            f"{outcome.result:6} {outcome.seconds * 1000:4.0f} ms {combination}"
            f" (seed {seed + number}) {outcome.remark}"
        )
        yield outcome
