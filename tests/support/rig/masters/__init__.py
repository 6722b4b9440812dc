"""Proxies in three masters at a rig that fails in the middle of a run: the values that each master
goes on to read, and their true ages.

The rig's charge is the time at which it was measured, on the clock that all processes of a machine
share. So the true age of every value that is read is known, whatever the proxy says of it.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import zmq

from fmus import component
from fmus.kit import stack
from fmus.kit.build.building import build
from fmus.kit.build.toolchain import host_platform
from tests.support import hosts
from tests.support.rig.process import module_process
from tests.support.rig.relay import listening, relay
from tests.support.rig.small_rig import free_port

MASTERS = ("fmpy", "libcosim", "Ecos")
FAULTS = {
    "hang": "the server is stopped (SIGSTOP)",
    "kill": "the server is killed (SIGKILL)",
    "stop": "an operator stops the rig",
    "dead": "there is no server from the start",
    "late": "every answer is held back for 0.2 s or more",
}
STEP = 0.02  # s
MAX_AGE = 0.15  # s
TIMEOUT = 0.5  # s
LATE = 0.2  # s
GOOD, AFTER = 15, 60  # steps before and after the fault
LINK_STATES = ("connected", "commands refused", "stale", "lost")
# s by which a value may be older than it says: between the evaluation by the FMU and the reading
# by the test lies the work of the master, whose last step it was
SLACK = 0.05
_NAME = "rig_proxy"
_NUMBERS = ("charge", "charge_age", "round_trip_time")


@dataclass(frozen=True)
class Row:
    """Values of a master after a step.

    Attributes
    ----------
    clock : float
        Time of the reading, s of the clock of all processes.
    error : str
        Message of the master about the step; empty if it is content.
    charge, charge_age, round_trip_time : float
        As read, s; the charge is when the rig measured it.
    link_state : int
    """

    clock: float
    error: str
    charge: float
    charge_age: float
    round_trip_time: float
    link_state: int

    @property
    def understated(self) -> float:
        """Excess of the true age over the stated one, s."""
        return self.clock - self.charge - self.charge_age


@dataclass(frozen=True)
class Observed:
    """Result of a run.

    Attributes
    ----------
    refused : str
        Reason for which there was no run; empty if there was one.
    before, after : list of Row
        The steps before and after the fault.
    """

    refused: str
    before: list[Row]
    after: list[Row]

    def looks_fresh(self) -> list[Row]:
        """Rows that a careful reader would take for fresh, and that are not."""
        return [
            row
            for row in (*self.before, *self.after)
            if not row.error
            and row.link_state < LINK_STATES.index("stale")
            and row.charge_age <= MAX_AGE
            and row.understated > SLACK
        ]


def observe(master: str, runtime: str, fault: str, folder: Path) -> Observed:
    """Run a proxy in a master at a rig, and have the rig fail."""
    with ExitStack() as opened:
        port = free_port()
        server = None
        if fault != "dead":
            server = opened.enter_context(module_process(__name__, "--serve", port))
        endpoint, act = opened.enter_context(_failing(fault, port, server))
        archive = folder / f"{_NAME}.fmu"
        defaults = {
            "endpoint": endpoint,
            "communication_timeout": TIMEOUT,
            "max_age": MAX_AGE,
            "deadline": 0.03,
        }
        made = stack(component(_NAME), name=_NAME, defaults=defaults)
        archive.write_bytes(build(made, runtime, [host_platform()]))
        now, done = folder / "now", folder / "done"
        ended = threading.Event()

        def wait_and_act() -> None:
            while not now.exists():
                if ended.wait(1e-3):
                    return
            act()
            done.touch()

        waiting = threading.Thread(target=wait_and_act, daemon=True)
        waiting.start()
        try:
            finished = hosts.finish_in_subprocess(
                f"{__name__}:rows_of", master, str(archive), str(now), str(done), timeout=60.0
            )
        finally:
            ended.set()
            waiting.join(5.0)
    if finished.result is None:  # libcosim ends the process where an FMU cannot begin
        assert fault == "dead", finished.output
        return Observed(finished.output.strip().splitlines()[-1], [], [])
    refused, rows = finished.result
    return Observed(refused, rows[:GOOD], rows[GOOD:])


@contextmanager
def _failing(
    fault: str, port: int, server: subprocess.Popen[str] | None
) -> Iterator[tuple[str, Callable[[], object]]]:
    """Give the endpoint to connect to, and what makes the rig fail."""
    endpoint = f"tcp://127.0.0.1:{port}"
    if fault == "late":
        hold = threading.Event()

        def spoil(client: socket.socket, data: bytes) -> None:
            if hold.is_set():
                time.sleep(LATE)
            client.sendall(data)

        with listening(relay(endpoint, spoil)) as through:
            yield through, hold.set
        return
    acts: dict[str, Callable[[], object]] = {
        "hang": lambda: server and os.kill(server.pid, signal.SIGSTOP),
        "kill": lambda: server and (server.kill(), server.wait(10.0)),
        "stop": lambda: _stop(port + 2),
        "dead": lambda: None,
    }
    yield endpoint, acts[fault]


def _stop(port: int) -> None:
    """Stop the rig as an operator does, and wait for the answer."""
    context = zmq.Context()
    operator = context.socket(zmq.DEALER)
    operator.routing_id = b"operator"
    operator.connect(f"tcp://127.0.0.1:{port}")
    operator.send_json({"ppy": 2, "type": "stop", "reason": "the emergency stop was pressed"})
    assert operator.poll(5000)
    context.destroy(linger=0)


# --- in the process of the master
# --------------------------------------------------------------------------------------------------


def rows_of(master: str, archive: str, now: str, done: str) -> tuple[str, list[Row]]:
    """Step a proxy in a master; return why it could not begin, and what it read after each step."""
    rows: list[Row] = []
    with ExitStack() as opened:
        try:
            step, read = _OPENERS[master](opened, archive)
        except Exception as error:
            return str(error) or type(error).__name__, rows
        for k in range(GOOD + AFTER):
            if k == GOOD:
                Path(now).touch()
                while not Path(done).exists():
                    time.sleep(1e-3)
            begun = time.monotonic()
            error = step(k)
            values = read()
            rows.append(Row(time.monotonic(), error, *values))
            # a step that fails does not wait, and a master that goes on must not race to its end
            time.sleep(max(0.0, begun + STEP - time.monotonic()))
    return "", rows


Step = Callable[[int], str]
Read = Callable[[], tuple[float, float, float, int]]


def _open_fmpy(opened: ExitStack, archive: str) -> tuple[Step, Read]:
    folder = opened.enter_context(hosts.extracted(archive))
    fmu = hosts.slave(folder)
    variables = hosts._variables(hosts.fmpy.read_model_description(str(folder), validate=False))
    fmu.instantiate()
    opened.callback(fmu.freeInstance)
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    references = [variables[name].valueReference for name in _NUMBERS]

    def step(k: int) -> str:
        try:
            fmu.doStep(STEP * k, STEP)
        except Exception as error:
            return str(error)
        return ""

    def read() -> tuple[float, float, float, int]:
        state = fmu.getInteger([variables["link_state"].valueReference])
        charge, age, trip = fmu.getReal(references)
        return charge, age, trip, state[0]

    return step, read


def _open_libcosim(opened: ExitStack, archive: str) -> tuple[Step, Read]:
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    variables = hosts._variables(hosts.fmpy.read_model_description(archive, validate=False))
    execution = CosimExecution.from_step_size(round(STEP * hosts.NANOSECONDS))
    local = CosimLocalSlave(fmu_path=archive, instance_name="instance")
    index = execution.add_local_slave(local)
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    opened.callback(lambda: (execution, local, observer))  # they live as long as they are used
    references = [variables[name].valueReference for name in _NUMBERS]

    def step(k: int) -> str:
        return "" if execution.step() else hosts._libcosim_error() or "step failed"

    def read() -> tuple[float, float, float, int]:
        state = observer.last_integer_values(index, [variables["link_state"].valueReference])
        charge, age, trip = observer.last_real_values(index, references)
        return charge, age, trip, state[0]

    if error := step(0):  # libcosim initializes with its first step
        raise RuntimeError(error)
    return step, read


def _open_ecos(opened: ExitStack, archive: str) -> tuple[Step, Read]:
    hosts.preload_tbb()
    from ecospy import EcosLib, EcosSimulation, EcosSimulationStructure

    structure = EcosSimulationStructure()
    structure.add_model("instance", archive)
    simulation = EcosSimulation(structure=structure, step_size=STEP)
    opened.callback(structure.free)
    opened.callback(simulation.free)
    if not simulation.init(0.0):
        raise RuntimeError(EcosLib.get_last_error())

    def step(k: int) -> str:
        simulation.step()
        return ""

    def read() -> tuple[float, float, float, int]:
        charge, age, trip = (simulation.get_real(f"instance::{name}") for name in _NUMBERS)
        return charge, age, trip, simulation.get_integer("instance::link_state")

    return step, read


_OPENERS: dict[str, Callable[[ExitStack, str], tuple[Step, Read]]] = {
    "fmpy": _open_fmpy,
    "libcosim": _open_libcosim,
    "Ecos": _open_ecos,
}
