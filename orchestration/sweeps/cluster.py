"""Cases run by the workers of a Dask cluster, whose machines need this package and nothing of this sweep."""

from __future__ import annotations

import hashlib
import tempfile
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from fmus.kit.storage import scratch
from orchestration.sweeps.crew import AHEAD, Part
from orchestration.sweeps.parts import Parts
from orchestration.sweeps.task import Outcomes, Repeated, Task, failed

Array = NDArray[np.float64]
_PATIENCE = 30.0  # s without anything done, after which it is asked whether there are workers


@dataclass(frozen=True)
class Parcel:
    """A task with the files that it names, which are not on the machines of a cluster.

    Attributes
    ----------
    task : Task
    fmu : bytes
    library : bytes
        Compiled code; empty without.
    digest : str
        Of all of it.
    """

    task: Task
    fmu: bytes
    library: bytes
    digest: str


def packed(task: Task) -> Parcel:
    """Read the files of a task."""
    fmu, library = (
        task.path.read_bytes(),
        task.equations.library.read_bytes() if task.equations else b"",
    )
    of_task = (
        repr(task).encode()
        + task.time.tobytes()
        + b"".join(v.tobytes() for v in task.inputs.values())
    )
    return Parcel(task, fmu, library, hashlib.sha256(fmu + library + of_task).hexdigest())


def outcomes_of_cluster(
    address: str, task: Task, cases: Array, which: Sequence[int]
) -> Iterator[Part]:
    """Run cases on a cluster, and tell each as soon as it is there.

    Parameters
    ----------
    address : str
        Of its scheduler, such as ``tcp://10.0.0.5:8786``.
    task : Task
    cases : ndarray, shape (n, p)
    which : sequence of int
        Rows to run.

    Yields
    ------
    list of int and Outcomes
        Rows, and what they left; in any order. A case that ends its worker again and again fails.

    Raises
    ------
    UserError
        If `distributed` is not installed, there is no such cluster, it has no workers, or they cannot run the task.
    """
    with Repeated(task):  # what is wrong with the FMU is told here, in one line
        pass
    client, threads = _connected(address)
    parts = Parts(task, which, threads)
    suspects: deque[list[int]] = (
        deque()
    )  # cases of parts whose worker ended, which may not be to blame
    running: dict[Any, list[int]] = {}
    try:
        # as a result, which is made again where the workers that have it end; what is scattered would be lost with them
        parcel = client.submit(unpacked, packed(task), pure=False)
        while parts or running or suspects:
            alone = not parts and not running
            while (parts or alone) and len(running) < (1 if alone else AHEAD * threads):
                rows = suspects.popleft() if alone else parts.next()
                # a result is not known by its arguments: a part that is told again is run again
                running[client.submit(work, parcel, cases[rows], pure=False)] = rows
            for future in _done(client, running, address):
                rows = running.pop(future)
                for part in _results(future, rows, task, None if alone else suspects, address):
                    parts.took(len(rows), part[1].seconds)
                    yield part
    finally:
        client.cancel([*running])
        with suppress(OSError, TimeoutError):  # what is gone has nothing to let go of
            client.run(let_go, on_error="ignore")
        client.close()


def _connected(address: str) -> tuple[Any, int]:
    """Return a client of a cluster, and how many cases it can run at once."""
    try:
        from distributed import Client
    except ImportError as error:
        raise UserError("--scheduler needs distributed: pip install 'ppy-rig[cluster]'") from error
    _check_address(address)
    try:
        client: Any = Client(address, timeout=10.0, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise UserError(f"--scheduler {address}: no scheduler answers there") from error
    try:
        client.wait_for_workers(1, timeout=_PATIENCE)
    except TimeoutError as error:
        client.close()
        raise UserError(f"--scheduler {address}: it has no workers") from error
    return client, max(1, sum(client.nthreads().values()))


def _check_address(address: str) -> None:
    """Refuse what no client can be made with: one that fails half-way waits for long, and tells of it at the end."""
    import dask
    from distributed.comm import get_address_host_port
    from distributed.security import Security

    try:
        _, port = get_address_host_port(address, strict=True)
        if not 0 < port < 65536:
            raise ValueError
    except (ValueError, ImportError) as error:
        raise UserError(
            f"--scheduler {address}: no address of a scheduler, such as tcp://10.0.0.5:8786"
        ) from error
    certified = Security().get_connection_args("client").get("ssl_context") is not None
    certified = certified or bool(dask.config.get("distributed.client.security-loader", None))
    if address.startswith(("tls:", "wss:")) and not certified:
        raise UserError(
            f"--scheduler {address}: Dask has no certificates for it (distributed.comm.tls)"
        )


def _done(client: Any, running: dict[Any, list[int]], address: str) -> list[Any]:
    """Wait for the next that are done."""
    from distributed import wait

    while True:
        try:
            with client.as_current():
                return [*wait([*running], timeout=_PATIENCE, return_when="FIRST_COMPLETED").done]
        except TimeoutError as error:
            if not client.nthreads():
                raise UserError(
                    f"--scheduler {address}: all its workers are gone; with --out the same command goes on where it was"
                ) from error


def _results(
    future: Any, rows: list[int], task: Task, suspects: deque[list[int]] | None, address: str
) -> Iterator[Part]:
    """Take what a part left; where its worker ended, its cases are run again alone, and blamed if it ends then."""
    from distributed.scheduler import KilledWorker

    try:
        yield rows, future.result()
    except KilledWorker:
        # Dask blames all that a worker was told, what it had not begun with, too
        if suspects is None:
            yield rows, failed(task, f"{task.path.name}: the process that ran it ended")
        else:
            suspects.extend([row] for row in rows)
    except UserError:
        raise
    except Exception as error:
        line = " ".join(str(error).split()) or type(error).__name__
        raise UserError(f"--scheduler {address}: a worker failed ({line})") from error


# ---- on a worker ----------------------------------------------------------------------------------------------------

_lock = Lock()  # a worker may have several threads; an instance has one
_open: tuple[str, Repeated, Any] | None = (
    None  # what was run last: its digest, what runs it, the folder of its files
)


def unpacked(parcel: Parcel) -> Parcel:
    """Return what is there for all parts."""
    return parcel


def work(parcel: Parcel, cases: Array) -> Outcomes:
    """Run cases (k, p) on a worker, which keeps what runs them for the next."""
    with _lock, _in_its_folder():
        return _repeated(parcel).run(cases)


def let_go() -> None:
    """Close and remove what a worker has open, unless it is busy with it; it is removed when the worker ends, too."""
    if _lock.acquire(blocking=False):
        try:
            _close()
        finally:
            _lock.release()


@contextmanager
def _in_its_folder() -> Iterator[None]:
    """Have all that is unpacked in the folder of the worker, which Dask removes even if its process is killed."""
    from distributed import get_worker

    before, tempfile.tempdir = tempfile.tempdir, get_worker().local_directory
    try:
        yield
    finally:
        tempfile.tempdir = before


def _close() -> None:
    global _open
    if _open is not None:
        _open[1].__exit__(None, None, None)
        scratch.remove(_open[2])
        _open = None


def _repeated(parcel: Parcel) -> Repeated:
    global _open
    if _open is not None and _open[0] == parcel.digest:
        return _open[1]
    _close()
    folder = scratch.make("sweep")
    try:
        with scratch.written(folder):
            repeated = Repeated(_written(parcel, folder))
        repeated.__enter__()
    except BaseException:
        scratch.remove(folder)
        raise
    _open = parcel.digest, repeated, folder
    return repeated


def _written(parcel: Parcel, folder: Path) -> Task:
    """Write the files of a task into a folder."""
    task = replace(parcel.task, path=folder / parcel.task.path.name)
    task.path.write_bytes(parcel.fmu)
    if task.equations:
        library = folder / task.equations.library.name
        library.write_bytes(parcel.library)
        task = replace(task, equations=replace(task.equations, library=library))
    return task
