"""Claims: an archive for pythonfmu computes the same as the other builds, and keeps its promises.

Everything runs in processes of their own: stock pythonfmu may crash one, which
``test_stock_pythonfmu_hazards.py`` has.
"""

from __future__ import annotations

import functools
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu

from fmus import COMPONENTS, component
from fmus.kit import Component, stack
from fmus.kit import build as kit
from orchestration.fmu.check import check_fmu
from orchestration.fmu.model import find_class
from tests.contract import checks, structure
from tests.contract.models import BrokenRate, Oscillator, Sampler
from tests.contract.raw import FATAL, Instance, Library, doubles, resident, unzipped
from tests.contract.schedule import go, schedule
from tests.contract.subjects import SUBJECTS, TELLING_NAMES
from tests.support import hosts
from tests.support.pace import slow_but

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="the hosts of the tests run on Linux"
)
pytest.importorskip("pythonfmu", reason="pythonfmu is not installed")

ALL = [*COMPONENTS, "Sampler", "Oscillator"]
OTHERS = {"Sampler": Sampler, "Oscillator": Oscillator}
each = pytest.mark.parametrize("name", slow_but(ALL, "voice_coil_dma", "Sampler"))
finish = functools.partial(hosts.finish_in_subprocess, clean_exit=False)


def model(name: str) -> type[Component]:
    return OTHERS[name] if name in OTHERS else component(name)


@pytest.fixture(scope="module")
def stock(tmp_path_factory) -> Callable[[str], Path]:
    """Path of the archive for pythonfmu, built once."""
    folder = tmp_path_factory.mktemp("stock")

    @functools.cache
    def path(name: str) -> Path:
        file = folder / f"{name}.fmu"
        file.write_bytes(kit.build(model(name), "pythonfmu", ["linux64"]))
        return file

    return path


def works(function: Callable, *arguments):
    finished = finish(function, *arguments)
    assert finished.returncode == 0, finished.output
    return finished.result


# --- numbers
# --------------------------------------------------------------------------------------------------


def stimulus(name: str, n: int = 40) -> tuple[np.ndarray, dict, list[str]]:
    """Equal steps, inputs that jump at every one, and the real outputs.

    One that has a least value, as a limit of the voltage, keeps its sign.
    """
    random, cls = np.random.default_rng(3), component(name)
    lows = {v.name: -1.0 if v.min is None else 0.5 for v in cls.layout.inputs}
    inputs = {
        signal: value * random.uniform(lows[signal], 1.5, n)
        for signal, value in SUBJECTS[name].inputs.items()
    }
    return (
        cls.experiment[1] * np.arange(n),
        inputs,
        [v.name for v in cls.layout.measurable if v.type == "real"],
    )


def close(found, wanted, outputs):
    for output in outputs:
        scale = np.nanmax(np.abs(wanted[output])) or 1.0
        assert np.nanmax(np.abs(found[output] - wanted[output])) <= 1e-9 * scale, output
    assert any(np.ptp(wanted[output][1:]) > 0.0 for output in outputs)


@pytest.mark.parametrize("changed", [False, True], ids=["defaults", "changed"])
@pytest.mark.parametrize("name", slow_but(COMPONENTS, *TELLING_NAMES))
def test_the_numbers_are_those_of_the_native_build_in_fmpy(stock, fmu, name, changed):
    """Also with other parameters, more accuracy, and outputs read before inputs are set."""
    times, inputs, outputs = stimulus(name)
    times = np.cumsum(np.random.default_rng(4).choice([0.3, 1.0, 2.7], times.size)) * times[1]
    given = (
        {"parameters": dict(SUBJECTS[name].parameters), "tolerance": 1e-11, "feedthrough": False}
        if changed
        else {"tolerance": SUBJECTS[name].tolerance}
    )
    run = functools.partial(hosts.run_fmpy, times=times, inputs=inputs, outputs=outputs, **given)
    close(works(run_with, str(stock(name)), run.keywords), run(fmu(name, "native")), outputs)


def run_with(archive: str, given: dict) -> dict:
    return hosts.run_fmpy(archive, **given)


@pytest.mark.slow
@pytest.mark.parametrize("name", slow_but(COMPONENTS, *TELLING_NAMES))
def test_the_numbers_are_those_of_the_native_build_in_libcosim(stock, fmu, name):
    """It runs on until the protection of a galvanostat, whose limit was not set yet, lets go."""
    times, inputs, outputs = stimulus(name, 400 if name == "galvanostat" else 40)
    real = {
        n: v
        for n, v in inputs.items()
        if {i.name: i.type for i in component(name).layout.inputs}[n] == "real"
    }
    found = hosts.run_libcosim(stock(name), times, real, outputs, clean_exit=False)
    wanted = hosts.run_libcosim(fmu(name, "native"), times, real, outputs)
    assert np.isnan(found[outputs[0]][0])
    close({k: v[1:] for k, v in found.items()}, {k: v[1:] for k, v in wanted.items()}, outputs)


# --- what it holds of the contract
# ----------------------------------------------------------------------------------


@each
def test_fmpy_finds_no_problem_and_ppy_check_what_is_the_doing_of_the_binary(stock, name):
    assert validate_fmu(str(stock(name))) == []
    findings = [f for f in check_fmu(stock(name)) if f.severity != "note"]
    assert {f.severity for f in findings} == {"warning"}
    told = " ".join(f.message for f in findings)
    assert "PyBool_FromLong" in told
    assert "libstdc++" in told
    assert all(f"binaries/linux64/{model(name).name}.so" in f.message for f in findings)


@each
def test_every_unknown_is_listed_with_its_true_dependencies(stock, name):
    structure.every_unknown_is_listed(stock(name))
    works(structure.dependencies_are_those_found_by_differences, stock(name))


def states(archive: Path) -> None:
    checks.going_on_from_a_saved_state_gives_the_same_bits(archive)
    checks.a_state_may_be_restored_anywhere(archive)


@each
def test_the_state_is_the_whole_state(stock, name):
    works(states, stock(name))


def serialised(archive: Path) -> bool:
    """True if an instance goes on alike from a state, and from the same state out of its bytes."""
    with hosts.extracted(archive) as folder:
        one = hosts.slave(folder)
        one.instantiate()
        one.setupExperiment()
        one.enterInitializationMode()
        one.exitInitializationMode()
        one.doStep(0.0, 0.05)
        state, values = one.getFMUState(), []
        for taken in (state, one.deSerializeFMUstate(one.serializeFMUstate(state))):
            one.setFMUState(taken)
            one.doStep(0.05, 0.013)
            values.append(one.serializeFMUstate(one.getFMUState()))
        return values[0] == values[1]


@each
def test_a_state_survives_as_bytes(stock, name):
    assert works(serialised, stock(name))


CLOCK = '''
from fmus.kit import Component, Output, State

class Chronometer(Component):
    """Shows the time."""

    name = "clock"
    x = State("s", rate="x_rate")

    def x_rate(self):
        return 1.0

    @Output("s")
    def now(self):
        """Time."""
        return self.time
'''


def watched(archive: Path) -> list[float]:
    """Return an output at three points, and at the second one restored.

    That was saved before anything was read there.
    """
    with unzipped(archive) as folder, Instance(Library(folder)) as one:
        one.initialize()
        seen = one.get("now")
        one.step(0.5)
        state = one.save()
        seen += one.get("now")
        one.step(0.25)
        seen += one.get("now")
        one.restore(state)
        return [*seen, *one.get("now")]


def test_outputs_follow_a_step_and_a_restored_state_by_themselves(tmp_path):
    (tmp_path / "clock.py").write_text(CLOCK)
    archive = tmp_path / "clock.fmu"
    archive.write_bytes(
        kit.build(find_class(f"{tmp_path / 'clock.py'}:Chronometer"), "pythonfmu", ["linux64"])
    )
    assert works(watched, archive) == [0.0, 0.5, 0.75, 0.5]


def beside(first: Path, second: Path) -> list[bytes]:
    """Return an instance's values alone, after a reset, and beside other instances."""
    with unzipped(first) as here, unzipped(second) as there:
        library, other = Library(here), Library(there)
        with (
            Instance(library) as one,
            Instance(library, b"twin") as twin,
            Instance(other, b"other") as stranger,
        ):
            results = []
            moves = schedule(library, 1, checks.STEPS)
            one.initialize()
            results.append(go(one, moves))
            one.do("fmi2Reset")
            one.initialize()
            twin.initialize()
            stranger.initialize()
            halves = b""
            for move in moves:
                halves += go(one, [move])
                go(twin, schedule(library, 2, 1))
                go(stranger, schedule(other, 3, 1))
            results.append(halves)
            return results


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "second"), [("ppy_actuator", "galvanostat"), ("degradation_estimator", "Sampler")]
)
def test_instances_and_fmus_do_not_see_each_other_and_a_reset_is_a_fresh_start(stock, name, second):
    alone, among = works(beside, stock(name), stock(second))
    assert alone == among


def refusals(archive: Path, values: dict[str, float]) -> tuple[int, list[str]]:
    with unzipped(archive) as folder, Instance(Library(folder), logging=1) as one:
        one.do("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
        one.set(values)
        one.do("fmi2EnterInitializationMode")
        return one.call("fmi2ExitInitializationMode"), one.messages


def test_a_parameter_out_of_range_is_refused_fatally_by_name_value_and_range(stock):
    status, messages = works(refusals, stock("ppy_actuator"), {"R1": -1.0})
    assert status == FATAL
    assert "parameter 'R1' = -1 ohm is outside [0, 1e+06]" in " ".join(messages)


def tuned(archive: Path) -> tuple[list[float], list[int], list[str]]:
    """Readings of a margin while its limit moves, then statuses of values that are not taken."""
    with unzipped(archive) as folder, Instance(Library(folder), logging=1) as one:
        one.initialize({"force": 1.0, "force_limit": 3.0})
        one.step(0.1)
        found = one.get("force_margin")
        one.set({"force_limit": 5.0})
        found += one.get("force_margin")
        one.step(0.1)
        found += one.get("force_margin")
        refused = [
            one.call("fmi2SetReal", one.references([name]), 1, doubles(value))
            for name, value in {"force_limit": -1.0, "R1": 0.5}.items()
        ]
        return found, refused, one.messages


def test_tunable_parameters_are_taken_between_steps(stock):
    found, refused, messages = works(tuned, stock("ppy_actuator"))
    assert found == pytest.approx([2.0, 4.0, 4.0], abs=1e-12)
    assert refused == [FATAL, FATAL]
    text = " ".join(messages)
    assert "parameter 'force_limit' = -1 N is outside [0, 1e+09]" in text
    assert "R1 cannot be set after initialization" in text


def broken(archive: Path) -> tuple[int, list[str]]:
    """Status and messages of a step in which a law raises."""
    with unzipped(archive) as folder, Instance(Library(folder), logging=1) as one:
        one.initialize({"current": 6.0})
        return one.call("fmi2DoStep", 0.0, 0.1, 1), one.messages


def printed(archive: Path) -> None:
    """Print the same in fmpy; the instance is not used after that."""
    with hosts.extracted(archive) as folder:
        one = hosts.slave(folder)
        one.instantiate(loggingOn=True)
        one.setupExperiment()
        one.enterInitializationMode()
        one.setReal([component("ppy_actuator").layout.names.index("current")], [6.0])
        one.exitInitializationMode()
        with pytest.raises(FMICallException):
            one.doStep(0.0, 0.1)


@pytest.mark.slow
def test_a_bug_in_a_law_is_fatal_and_told_with_its_per_cents(tmp_path):
    archive = tmp_path / "broken.fmu"
    archive.write_bytes(
        kit.build(stack(component("ppy_actuator"), BrokenRate), "pythonfmu", ["linux64"])
    )
    status, messages = works(broken, archive)
    assert status == FATAL
    assert "ValueError: 100 % broken, %s %n" in " ".join(messages)
    finished = finish(printed, archive)  # through a logger that reads the message as a format
    assert finished.returncode == 0, finished.output
    assert "ValueError: 100 % broken, %s %n" in finished.output


@each
def test_the_same_sources_give_the_same_bytes(stock, name):
    again = kit.build(model(name), "pythonfmu", ["linux64"])
    assert again == stock(name).read_bytes()
    checks.no_time_and_no_order_of_this_machine(stock(name))


@pytest.mark.slow
def test_different_components_have_different_modules(stock):
    """Modules of one name would be one in a process."""
    scripts = set()
    for name in ALL:
        with zipfile.ZipFile(stock(name)) as archive:
            scripts.add(archive.read("resources/slavemodule.txt"))
            assert b"NTNU" in archive.read("documentation/licenses/pythonfmu.txt")
    assert len(scripts) == len(ALL)


# --- what is not promised is not so
# ---------------------------------------------------------------------------------


def accepted(archive: Path) -> dict[str, int]:
    """Statuses of what the contract refuses; an instance under another GUID."""
    with unzipped(archive) as folder, Instance(Library(folder), guid=b"not the GUID") as one:
        found = {"guid": 0 if one.component else 1}
        one.initialize()
        found["time"] = one.call("fmi2DoStep", 77.0, one.library.step, 1)
        found["order"] = one.call("fmi2EnterInitializationMode")
        return found


def test_arguments_that_the_contract_refuses_are_accepted(stock):
    assert works(accepted, stock("ppy_actuator")) == {"guid": 0, "time": 0, "order": 0}


def growth(archive: Path, cycles: int) -> float:
    """Resident bytes for each instance created and freed."""
    with unzipped(archive) as folder:
        library = Library(folder)

        def cycle(count: int) -> int:
            for _ in range(count):
                Instance(library).free()
            return resident()

        before = cycle(100)
        return (cycle(cycles) - before) / cycles


def test_every_instance_leaks(stock):
    assert works(growth, stock("ppy_actuator"), 300) > 1024.0
