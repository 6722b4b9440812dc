"""Something fails while ``ppy run hil_bench --real-time`` drives the rig.

A simulated bench is in a loop with what the server takes for a real actuator.
"""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable
from typing import Any

from tests.support.rig.bad_link import BadLink, Treatment, damaging, delaying, doubling, dropping
from tests.support.rig.faults.bench import Bench, fault
from tests.support.rig.peer import Peer, operators
from tests.support.rig.process import ROOT, Server, hil_bench
from tests.support.rig.terminal import Terminal

_LIMITS = ((-1.3, 1.3), (-0.02, 0.02))  # of the commands of the actuator
_DURATION = 4.0  # s, of the run
_STARTS = 10  # of a run, at most
_ENDS = "safe; the run ends with one line that says why, and an exit status that is not 0"
_GOES_ON = "the run goes on to its end, or the rig is safe and the run says why"


def _serve(bench: Bench, where: str = "", how: str = "", **more: Any) -> Server:
    """Serve an actuator, one of whose calls fails when the trigger is pulled."""
    bench.limits = _LIMITS
    options = {"trigger": bench.folder / "trigger", "where": where, "how": how}
    return bench.serve("Actuator", "--rate", 200, options=options, **more)


def _run(bench: Bench, disturb: Callable[[], object]) -> subprocess.CompletedProcess[str]:
    """Run hil_bench, and let something happen in its course."""
    bench.link = BadLink(bench.server.endpoint, watchdog=bench.watchdog, limits=_LIMITS)
    run = _started(bench)
    try:
        time.sleep(0.5)
        disturb()
        output, errors = run.communicate(timeout=60.0)
    finally:
        run.kill()
        bench.link.close()
    return subprocess.CompletedProcess(run.args, run.returncode, output, errors)


def _started(bench: Bench) -> subprocess.Popen[str]:
    """Start a run, and wait until it commands; on a busy machine it may be refused at first."""
    for _ in range(_STARTS):
        run = subprocess.Popen(
            hil_bench(bench.link.endpoint, _DURATION),
            cwd=bench.folder,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        while run.poll() is None:
            if any(call.what.startswith("write 0.4") for call in bench.server.calls()):
                return run
            time.sleep(0.01)
        _, errors = run.communicate()
        assert "this machine does not hold" in errors, f"it ended before it began: {errors}"
    raise AssertionError(f"this machine refuses to run it, {_STARTS} times")


def _ends(bench: Bench, disturb: Callable[[], object]) -> None:
    """Safe in time, and the run says why it ended."""
    begun: list[float] = []

    def note_and_disturb() -> None:
        begun.append(time.monotonic())
        disturb()

    done = _run(bench, note_and_disturb)
    for process in bench.server.family():
        os.kill(process, signal.SIGCONT)
    safe = bench.safe_after(begun[0])
    bench.measure(begun[0], safe, "it failed")
    last = max(c.time for c in bench.server.calls() if c.what.startswith("write"))
    assert last < safe.time, "commands were carried out after the safe state"
    _says_why(bench, done)


def _says_why(bench: Bench, done: subprocess.CompletedProcess[str]) -> None:
    lines = done.stderr.strip().splitlines()
    assert done.returncode in (1, 2), f"exit status {done.returncode}; {lines[-1:]}"
    assert lines[-1].startswith("error: "), lines
    bench.observed = lines[-1].replace(str(bench.folder), "")


def _of_process(process: str, how: str) -> None:
    @fault(f"{how} of the {process}, while hil_bench runs", _ENDS)
    def fails(bench: Bench) -> None:
        pid = _serve(bench).roles()[process]
        _ends(bench, lambda: os.kill(pid, signal.Signals[how]))


def _of_signal(name: str) -> None:
    @fault(f"{name} by the server's terminal, while hil_bench runs", _ENDS)
    def ends(bench: Bench) -> None:
        server = _serve(bench, terminal=Terminal())
        _ends(bench, lambda: server.send(signal.Signals[name]))


def _of_call(where: str, how: str) -> None:
    @fault(f"the backend's {where}: {how}, while hil_bench runs", _ENDS)
    def fails(bench: Bench) -> None:
        _serve(bench, where, how)
        _ends(bench, bench.pull_trigger)


def _of_link(what: str, treatment: Treatment) -> None:
    @fault(f"{what}, while hil_bench runs", _GOES_ON)
    def disturbed(bench: Bench) -> None:
        _serve(bench)
        done = _run(bench, lambda: setattr(bench.link, "treatment", treatment))
        assert bench.link.fresh, "no command was fresh"
        last = max(bench.link.fresh)
        bench.measure(last, bench.safe_after(last), "last fresh command")
        if done.returncode:
            _says_why(bench, done)
        else:
            bench.observed = "the run went on to its end"


@fault("ppy rig stop, while hil_bench runs", _ENDS)
def stopped(bench: Bench) -> None:
    server = _serve(bench)

    def stop() -> None:
        with Peer(operators(server.endpoint)) as peer:
            peer.ask("stop", reason="tried")

    _ends(bench, stop)


for _process in ("front", "guard", "device"):
    _of_process(_process, "SIGKILL")
    _of_process(_process, "SIGSTOP")
for _name in ("SIGINT", "SIGHUP", "SIGQUIT", "SIGTERM", "SIGUSR1"):
    _of_signal(_name)
for _where, _how in (
    ("read", "raise"),
    ("read", "exit"),
    ("read", "hang"),
    ("read", "nan"),
    ("write", "die"),
    ("write", "hang"),
):
    _of_call(_where, _how)
for _what, _treatment in (
    ("every message lost", dropping(1.0)),
    ("10 % of the messages lost", dropping(0.1)),
    ("messages delayed by 2 to 8 ms", delaying(0.002, 0.008)),
    ("messages delayed by more than the watchdog time", delaying(0.5, 0.6)),
    ("messages that overtake each other", delaying(0.0, 0.03)),
    ("every message doubled", doubling),
    ("1 in 5 messages damaged", damaging(0.2)),
):
    _of_link(_what, _treatment)
