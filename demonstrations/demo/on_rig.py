"""Closed loop on an emulated rig in real time: record, diagnose, run the extended model."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

from demonstrations.backend import Emulator
from demonstrations.demo import rig_page as demonstration_page
from fmus import component
from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.api import DiagnosisResult, diagnose
from orchestration.experiment import results
from orchestration.experiment.waveforms import multilevel
from orchestration.fmu import find_model
from orchestration.master import RealTime, Run
from orchestration.master import run as run_system
from orchestration.reporting import console as screen
from orchestration.system import Member, Port, System

MODEL = "ppy_actuator"
OUTPUTS = ("voltage", "displacement")
_RATE = 30.0  # Hz, of the thesis's rig
_SAMPLING = 120.0  # Hz, of the server, so that a command is applied early in its step
_BESIDE = 20.0  # s, duration of the run of models and rig
_END = 10.0  # s, after which the server is killed


@dataclass(frozen=True)
class RigDemoResults:
    """Results of the demonstration on a rig.

    Attributes
    ----------
    diagnosis : DiagnosisResult
        Diagnosis of the record of the rig.
    beside : Run
        Run of the rig, the nominal and the extended model.
    errors : Mapping of str to Mapping
        Normalised RMS error by model and output: of measured minus simulated values, over the
        standard deviation of the measured ones.
    hidden : str
        Hidden effect of the emulated rig.
    seconds : float
        Duration of the demonstration.
    """

    diagnosis: DiagnosisResult
    beside: Run
    errors: Mapping[str, Mapping[str, float]]
    hidden: str
    seconds: float


def run(out: Path, seed: int) -> Path:
    """Serve and record a rig, diagnose it, run models together with it, and report.

    Parameters
    ----------
    out : Path
        Folder for all output.
    seed : int
        Seed of the emulated rig and its hidden effect.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    UserError
        If the server does not start, or a step fails.
    """
    begin = perf_counter()
    out.mkdir(parents=True, exist_ok=True)
    options = {"hidden": "drawn", "seed": str(seed)}
    record = out / "record.nc"
    with _serve(out, options) as endpoint:
        _record(record, endpoint)
    diagnosed, extended = _diagnose(record)
    print(diagnosed)
    with _serve(out, options) as endpoint:
        beside = _run_beside(endpoint, extended, seed)
    hidden = Emulator(**options).tell()
    found = RigDemoResults(diagnosed, beside, errors(beside), hidden, perf_counter() - begin)
    _summarise(found)
    page = demonstration_page.write(out, found)
    print(f"report: {page}")
    return page


def _diagnose(record: Path) -> tuple[DiagnosisResult, Path]:
    """Return the diagnosis of a record, and the FMU of the extended model."""
    with screen.progress() as tell:
        diagnosed = diagnose(record, MODEL, progress=tell)
        report = record.with_name("diagnosis.html")
        diagnosed.report(report, f"ppy diagnose {record.name} --report {report.name}")
        extended, *_ = diagnosed.fmu(record.with_name("extended.fmu"))
    return diagnosed, extended


def _run_beside(endpoint: str, extended: Path, seed: int) -> Run:
    """Run the nominal and the extended model together with the rig, in real time."""
    time = np.arange(round(_BESIDE * _RATE) + 1) / _RATE
    with screen.progress(
        f"the same rig, rested; the extended model runs beside it for {_BESIDE:g} s"
    ) as tell:
        return run_system(
            side_by_side(endpoint, extended),
            time,
            _inputs(time, seed),
            real_time=RealTime(makes_up=False),
            feedthrough=False,  # outputs are read at the end of a step, as those of a rig
            progress=lambda done: tell.done(done, time.size),
        )


def _summarise(found: RigDemoResults) -> None:
    """Print the errors of both models, and the hidden effect of the rig."""
    for name in OUTPUTS:
        before = 100.0 * found.errors["nominal"][name]
        after = 100.0 * found.errors["extended"][name]
        print(
            f"beside the rig, in real time: error of {name} {before:.1f} % nominal -> {after:.1f} %"
            " extended"
        )
    print(f"what the rig hides: {found.hidden}")


def side_by_side(endpoint: str, extended: Path) -> System:
    """Return the system of a rig and two models of it, all with the same inputs.

    Parameters
    ----------
    endpoint : str
        Address of the rig's server.
    extended : Path
        FMU of the extended model.
    """
    members = (
        Member.of("rig", component("rig_proxy"), {"endpoint": endpoint, "on_stale": "fail"}),
        Member("nominal", find_model(MODEL).path),
        Member("extended", extended),
    )
    inputs = {
        name: tuple(Port(member.name, name) for member in members) for name in ("current", "force")
    }
    return System("beside_the_rig", members, (), inputs, step=1.0 / _RATE, stop=_BESIDE)


def errors(run: Run) -> dict[str, dict[str, float]]:
    """Return the normalised RMS error by model and output.

    The first point is omitted, as it comes before the first command.
    """
    errors_of: dict[str, dict[str, float]] = {}
    for model in ("nominal", "extended"):
        errors_of[model] = {}
        for name in OUTPUTS:
            measured = run.signals[f"rig.{name}"][1:]
            error = measured - run.signals[f"{model}.{name}"][1:]
            errors_of[model][name] = float(np.sqrt(np.mean(error**2)) / np.std(measured))
    return errors_of


def _inputs(time: Array, seed: int) -> dict[str, Array]:
    """Return inputs with levels that are not in the record."""
    return {
        "current": multilevel(time, [-0.9, -0.45, 0.0, 0.45, 0.9], (0.5, 3.0), seed + 1000),
        "force": multilevel(time, [0.5, 1.0, 1.5, 2.0, 2.75], (1.0, 4.0), seed + 2000),
    }


def _record(out: Path, endpoint: str) -> None:
    """Record the rig; rows without a value are omitted by a diagnosis.

    Raises
    ------
    UserError
        If the command fails.
    """
    try:
        _command(
            "rig", "record", "--stimulus", "identification", "--out", out, "--endpoint", endpoint
        )
    except UserError:
        if not out.exists() or "failure" in results.read(out).attrs:
            raise


def _command(*words: object) -> None:
    """Run a command ``ppy``, which prints its own errors.

    Raises
    ------
    UserError
        If the command fails.
    """
    texts = [str(word) for word in words]
    done = subprocess.run([sys.executable, "-m", "orchestration.cli", *texts])
    if done.returncode != 0:
        raise UserError(f"ppy {' '.join(texts)} ended with {done.returncode}")


@contextmanager
def _serve(out: Path, options: Mapping[str, str]) -> Iterator[str]:
    """Serve the emulated rig in other processes, and yield its address."""
    command = [
        sys.executable,
        "-m",
        "orchestration.cli",
        "rig",
        "serve",
        "--port",
        "0",
        "--log",
        str(out / "serve.log"),
    ]
    command += ["--rate", str(_SAMPLING)]
    command += [word for key, value in options.items() for word in ("--option", f"{key}={value}")]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        assert server.stdout is not None
        for line in server.stdout:
            if "ready: " in line:
                yield line.partition("ready: ")[2].split()[0]
                break
        else:
            raise UserError(f"the emulated rig cannot be served; {out / 'serve.log'} says why")
    finally:
        server.terminate()
        try:
            server.wait(_END)
        except subprocess.TimeoutExpired:
            server.kill()
            server.wait()
        if server.stdout is not None:
            server.stdout.close()
