"""Workers of a Dask cluster that run the cases of a sweep.

Their machines need this package alone: the files of the sweep are sent to them.
"""

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

from fmus.kit import UserError
from fmus.kit.arrays import Array
from fmus.kit.extras import optional
from fmus.kit.storage import scratch
from orchestration.reporting import option
from orchestration.sweeps.chunking import QUEUED, Chunks
from orchestration.sweeps.local_workers import RowsAndOutcomes
from orchestration.sweeps.task import CaseRunner, Outcomes, Task, failed_case

_PATIENCE = 30.0  # s without a result after which the cluster is checked for workers


@dataclass(frozen=True)
class TaskBundle:
    """A task with the contents of its files, for machines that do not have these files.

    Attributes
    ----------
    task : Task
    files : tuple of bytes
        Contents of the files of its source.
    library : bytes
        Compiled code; empty if the FMU runs the cases.
    digest : str
        SHA-256 of all of these.
    """

    task: Task
    files: tuple[bytes, ...]
    library: bytes
    digest: str


def bundle(task: Task) -> TaskBundle:
    """Return a task with the contents of its files."""
    contents = tuple(path.read_bytes() for path in task.source.files)
    library = task.equations.library.read_bytes() if task.equations else b""
    inputs = b"".join(values.tobytes() for values in task.inputs.values())
    whole = b"".join(contents) + library + repr(task).encode() + task.time.tobytes() + inputs
    return TaskBundle(task, contents, library, hashlib.sha256(whole).hexdigest())


def run_on_cluster(
    address: str, task: Task, cases: Array, open_rows: Sequence[int]
) -> Iterator[RowsAndOutcomes]:
    """Run cases on a cluster, and yield their outcomes in the order of completion.

    Parameters
    ----------
    address : str
        Address of its scheduler, such as ``tcp://10.0.0.5:8786``.
    task : Task
    cases : ndarray, shape (n, p)
    open_rows : sequence of int
        Rows to run.

    Yields
    ------
    list of int and Outcomes
        Rows and their outcomes. A case fails if it crashes its worker repeatedly.

    Raises
    ------
    UserError
        If `distributed` is not installed, there is no such cluster, it has no workers, or they
        cannot run the task.
    """
    with CaseRunner(task):  # raises an error here if the FMU cannot be opened
        pass
    client, threads = _connect(address)
    chunks = Chunks(task, open_rows, threads)
    # cases of chunks whose worker ended; only one of them may be the cause
    suspects: deque[list[int]] = deque()
    running: dict[Any, list[int]] = {}
    try:
        # as a result, which Dask computes again if its workers end; scattered data would be lost
        task_bundle = client.submit(identity, bundle(task), pure=False)
        while chunks or running or suspects:
            is_alone = not chunks and not running  # a suspect runs alone
            most_running = 1 if is_alone else QUEUED * threads
            while (chunks or is_alone) and len(running) < most_running:
                rows = suspects.popleft() if is_alone else chunks.next()
                # not pure, so that a chunk that is submitted again is run again
                running[client.submit(work, task_bundle, cases[rows], pure=False)] = rows
            for future in _wait_for_chunks(client, running, address):
                rows = running.pop(future)
                outcomes = _outcomes_of(future, task, is_alone, address)
                if outcomes is None:
                    suspects.extend([row] for row in rows)
                    continue
                chunks.adapt(len(rows), outcomes.seconds)
                yield rows, outcomes
    finally:
        client.cancel([*running])
        with suppress(OSError, TimeoutError):  # of workers that have ended
            client.run(release, on_error="ignore")
        client.close()


def _connect(address: str) -> tuple[Any, int]:
    """Return a client of a cluster, and the number of cases that it runs in parallel."""
    with optional():
        from distributed import Client
    _check_address(address)
    try:
        client: Any = Client(address, timeout=10.0, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise UserError(f"{option('scheduler', address)}: no scheduler answers there") from error
    try:
        client.wait_for_workers(1, timeout=_PATIENCE)
    except TimeoutError as error:
        client.close()
        raise UserError(f"{option('scheduler', address)}: it has no workers") from error
    return client, max(1, sum(client.nthreads().values()))


def _check_address(address: str) -> None:
    """Raise if no client can be made for an address.

    Dask itself would report that only after a long timeout.
    """
    import dask
    from distributed.comm import get_address_host_port
    from distributed.security import Security

    try:
        _, port = get_address_host_port(address, strict=True)
        if not 0 < port < 65536:
            raise ValueError
    except (ValueError, ImportError) as error:
        raise UserError(
            f"{option('scheduler', address)}: no address of a scheduler, such as tcp://10.0.0.5:8786"
        ) from error
    context = Security().get_connection_args("client").get("ssl_context")
    loader = dask.config.get("distributed.client.security-loader", None)
    has_certificates = context is not None or loader
    if address.startswith(("tls:", "wss:")) and not has_certificates:
        raise UserError(
            f"{option('scheduler', address)}: Dask has no certificates for it"
            " (distributed.comm.tls)"
        )


def _wait_for_chunks(client: Any, running: dict[Any, list[int]], address: str) -> list[Any]:
    """Wait until at least one chunk is finished, and return the finished ones."""
    from distributed import wait

    while True:
        try:
            with client.as_current():
                return [*wait([*running], timeout=_PATIENCE, return_when="FIRST_COMPLETED").done]
        except TimeoutError as error:
            if not client.nthreads():
                raise UserError(
                    f"{option('scheduler', address)}: all its workers have ended; with"
                    f" {option('folder')} the same sweep goes on after the finished cases"
                ) from error


def _outcomes_of(future: Any, task: Task, is_alone: bool, address: str) -> Outcomes | None:
    """Return the outcomes of a chunk; None if its worker ended, perhaps because of another chunk.

    Dask reports every chunk in the queue of a worker that ended, also those that had not begun.
    """
    from distributed.scheduler import KilledWorker

    try:
        outcomes: Outcomes = future.result()
        return outcomes
    except KilledWorker:
        if not is_alone:
            return None
        return failed_case(task, f"{task.source.name}: the process that ran it ended")
    except UserError:
        raise
    except Exception as error:
        line = " ".join(str(error).split()) or type(error).__name__
        raise UserError(f"{option('scheduler', address)}: a worker failed ({line})") from error


# ---- on a worker ---------------------------------------------------------------------------------

_lock = Lock()  # a worker may have several threads, an FMU instance only one
# digest, runner and folder of the newest task
_open_task: tuple[str, CaseRunner, Any] | None = None


def identity(task_bundle: TaskBundle) -> TaskBundle:
    """Return the bundle, so that the cluster has it as a result for all chunks."""
    return task_bundle


def work(task_bundle: TaskBundle, cases: Array) -> Outcomes:
    """Run a chunk of cases, shape (k, p), in this worker; the task stays open for the next."""
    with _lock, _in_worker_folder():
        return _runner_of(task_bundle).run(cases)


def release() -> None:
    """Close the open task of a worker and remove its files, unless it is running."""
    if _lock.acquire(blocking=False):
        try:
            _close_task()
        finally:
            _lock.release()


@contextmanager
def _in_worker_folder() -> Iterator[None]:
    """Use the folder of the worker for temporary files within the context.

    Dask removes that folder even if the process is killed.
    """
    from distributed import get_worker

    before = tempfile.tempdir
    tempfile.tempdir = get_worker().local_directory
    try:
        yield
    finally:
        tempfile.tempdir = before


def _close_task() -> None:
    """Close the runner of the open task, if there is one, and remove its files."""
    global _open_task
    if _open_task is not None:
        _open_task[1].__exit__(None, None, None)
        scratch.remove(_open_task[2])
        _open_task = None


def _runner_of(task_bundle: TaskBundle) -> CaseRunner:
    """Return the open runner of a task, which replaces that of another task."""
    global _open_task
    if _open_task is not None and _open_task[0] == task_bundle.digest:
        return _open_task[1]
    _close_task()
    folder = scratch.make("sweep")
    try:
        with scratch.written(folder):
            runner = CaseRunner(_unpack(task_bundle, folder))
        runner.__enter__()
    except BaseException:
        scratch.remove(folder)
        raise
    _open_task = task_bundle.digest, runner, folder
    return runner


def _unpack(task_bundle: TaskBundle, folder: Path) -> Task:
    """Write the files of a task into a folder, and return the task with their new paths."""
    source = task_bundle.task.source
    copies = []
    for k, (path, contents) in enumerate(zip(source.files, task_bundle.files, strict=True)):
        (folder / str(k)).mkdir()  # files of two members may have the same name
        copies.append(folder / str(k) / path.name)
        copies[-1].write_bytes(contents)
    task = replace(task_bundle.task, source=source.with_files(copies))
    if not task.equations:
        return task
    library = folder / task.equations.library.name
    library.write_bytes(task_bundle.library)
    return replace(task, equations=replace(task.equations, library=library))
