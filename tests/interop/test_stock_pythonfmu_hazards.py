"""Hazards of stock pythonfmu 0.7.0: the measured reasons for this project's own FMU front-end.

Every test asserts the hazard. When one fails, pythonfmu has been repaired, and the explanation in
the documentation and perhaps a part of the front-end can go. Whatever may crash runs in a process
of its own.
"""

from __future__ import annotations

import functools
import gc
import math
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave

from tests.support import hosts

pytestmark = [
    pytest.mark.slow,  # nothing here is ours, or changes but with a version of theirs
    pytest.mark.skipif(sys.platform != "linux", reason="measured on Linux"),
]
pytest.importorskip("pythonfmu", reason="pythonfmu is not installed")

FATAL = 4
SEGMENTATION_FAULT = -11
TEMPLATE = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real
{imports}

class {name}(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u = 0.0
        self.x = 0.0
        self.hidden = 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("x", causality=Fmi2Causality.output))
        {in_init}

    def exit_initialization_mode(self):
        {in_exit}

    def do_step(self, current_time, step_size):
        {in_step}
        return {answer}
"""


def source(
    name: str,
    *,
    in_init="pass",
    in_exit="pass",
    in_step="self.x += step_size * self.u",
    answer="True",
    imports="",
) -> str:
    """Text of a slave ``dx/dt = u`` with something put into one of its methods."""
    return TEMPLATE.format(
        name=name, in_init=in_init, in_exit=in_exit, in_step=in_step, answer=answer, imports=imports
    )


def fixed(what: str) -> str:
    return f"stock pythonfmu fixed {what}: update docs/explanation"


# At the exit of a process, pythonfmu reads memory it has freed, and rarely dies of it; that is not
# what is asked here.
in_subprocess = functools.partial(hosts.in_subprocess, clean_exit=False)
finish_in_subprocess = functools.partial(hosts.finish_in_subprocess, clean_exit=False)

# The builder instantiates every slave once under the name "dummyInstance": the fault must not hit
# that one.
SOURCES = {
    "Sound": source("Sound"),
    "FailsInStep": source("FailsInStep", in_step='raise ValueError("bad step")'),
    "FailsInExit": source("FailsInExit", in_exit='raise ValueError("bad exit")'),
    "FailsInInit": source(
        "FailsInInit",
        in_init='if self.instance_name != "dummyInstance": raise ValueError("bad init")',
    ),
    "FailsWithPercent": source(
        "FailsWithPercent", in_step='raise ValueError("100 %s %s %s %s %n")'
    ),
    "Discards": source("Discards", answer="current_time < 0.45"),
    "Hides": source("Hides", in_step="self.hidden += 1.0; self.x = self.hidden"),
}


@pytest.fixture(scope="module")
def build(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Build a slave of `SOURCES` once."""
    built: dict[str, Path] = {}

    def one(name: str) -> Path:
        if name not in built:
            built[name] = hosts.build_pythonfmu(
                tmp_path_factory.mktemp(name), name.lower(), SOURCES[name]
            )
        return built[name]

    return one


# --- what runs in the processes
# -------------------------------------------------------------------------------------


def _perform(model: FMU2Slave, call: str) -> Any:
    calls: dict[str, Callable[[], Any]] = {
        "instantiate": model.instantiate,
        "setup": model.setupExperiment,
        "enter": model.enterInitializationMode,
        "exit": model.exitInitializationMode,
        "step": lambda: model.doStep(0.0, 0.1),
        "get": lambda: model.getReal([1]),
        "get unknown": lambda: model.getReal([99]),
        "reset": model.reset,
        "terminate": model.terminate,
        "free": lambda: model.fmi2FreeInstance(model.component),
        "collect garbage": gc.collect,
    }
    return calls[call]()


def play(fmu: str, sequence: list[str], logging: bool = False) -> list[Any]:
    """Initialize, then make the calls; answers with the status of each that failed, else with its
    result.
    """
    answers = []
    with hosts.extracted(fmu) as folder:
        model = hosts.slave(folder)
        model.instantiate(loggingOn=logging)
        for call in ["setup", "enter", *sequence]:
            try:
                answers.append(_perform(model, call))
            except FMICallException as problem:
                answers.append(problem.status)
    return answers[2:]


def try_to_instantiate(fmu: str, folder: str | None = None, guid: str | None = None) -> bool:
    """Return whether fmi2Instantiate gives an instance, from a folder and under a GUID."""
    import fmpy

    with hosts.extracted(fmu) as unzipped:
        if folder is not None:
            fmpy.extract(fmu, unzipdir=folder)
        model = hosts.slave(folder or unzipped)
        model.guid = guid or model.guid
        try:
            model.instantiate()
        except Exception:
            return False
        model.fmi2FreeInstance(model.component)
    return True


def simulate(fmu: str) -> list[float]:
    """Times of a simulation to 1 s with fmpy's own master."""
    import fmpy

    return list(fmpy.simulate_fmu(fmu, stop_time=1.0, output_interval=0.1)["time"])


def grow(fmu: str, cycles: int) -> tuple[float, float]:
    """Growth of resident memory (KiB) and of ``sys.path`` (entries) per create/free cycle."""

    def resident() -> int:
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4

    with hosts.extracted(fmu) as folder:
        model = hosts.slave(folder)

        def cycle(count: int) -> None:
            for _ in range(count):
                model.instantiate()
                model.fmi2FreeInstance(model.component)
            gc.collect()

        cycle(200)
        memory, entries = resident(), len(sys.path)
        cycle(cycles)
        return (resident() - memory) / cycles, (len(sys.path) - entries) / cycles


def step_both(first: str, second: str) -> tuple[float, float]:
    """Output of two FMUs after one step, loaded into one process."""
    values = []
    for fmu in (first, second):
        with hosts.extracted(fmu) as folder:
            model = hosts.slave(folder)
            model.instantiate()
            model.setupExperiment()
            model.enterInitializationMode()
            model.exitInitializationMode()
            model.doStep(0.0, 0.1)
            values.append(model.getReal([1])[0])
    return values[0], values[1]


def abuse(fmu: str) -> dict[str, float]:
    """Output after a NaN input, after a negative step and after a step at the wrong time; none is
    refused.
    """
    results = {}
    for name, value, time, step in [
        ("nan", math.nan, 0.0, 0.1),
        ("negative step", 1.0, 0.0, -0.1),
        ("wrong time", 1.0, 77.0, 0.1),
    ]:
        with hosts.extracted(fmu) as folder:
            model = hosts.slave(folder)
            model.instantiate()
            model.setupExperiment()
            model.enterInitializationMode()
            model.exitInitializationMode()
            model.setReal([0], [value])
            model.doStep(time, step)
            results[name] = model.getReal([1])[0]
            model.fmi2FreeInstance(model.component)
    return results


def save_and_restore(fmu: str) -> tuple[float, float]:
    """Output one step after the state was saved, and one step after it was restored."""
    with hosts.extracted(fmu) as folder:
        model = hosts.slave(folder)
        model.instantiate()
        model.setupExperiment()
        model.enterInitializationMode()
        model.exitInitializationMode()
        model.doStep(0.0, 0.1)
        state = model.getFMUState()
        model.doStep(0.1, 0.1)
        before = model.getReal([1])[0]
        model.setFMUState(state)
        model.doStep(0.1, 0.1)
        return before, model.getReal([1])[0]


def fail_beside_another(failing: str, sound: str) -> float:
    """Output of a sound instance stepped after another instance failed and its remains were
    collected.
    """
    with hosts.extracted(failing) as first, hosts.extracted(sound) as second:
        bad, good = hosts.slave(first, "bad"), hosts.slave(second, "good")
        for model in (bad, good):
            model.instantiate()
            model.setupExperiment()
            model.enterInitializationMode()
            model.exitInitializationMode()
        with pytest.raises(FMICallException):
            bad.doStep(0.0, 0.1)
        gc.collect()
        good.setReal([0], [1.0])
        good.doStep(0.0, 0.1)
        return good.getReal([1])[0]


# --- exceptions
# --------------------------------------------------------------------------------------------------


def test_exception_in_a_step_is_fatal_and_not_error(build):
    returncode, answers = in_subprocess(play, str(build("FailsInStep")), ["exit", "step", "free"])
    assert (returncode, answers) == (0, [0, FATAL, None]), fixed("exceptions in do_step")


def test_reading_a_value_after_a_failed_step_crashes_once_garbage_is_collected(build):
    # The failing call drops the Python object but keeps the pointer; reference cycles keep the
    # object alive until the collector runs, and then the pointer dangles.
    sequence = ["exit", "step", "collect garbage", "get"]
    returncode, output = in_subprocess(play, str(build("FailsInStep")), sequence)
    assert returncode == SEGMENTATION_FAULT, (
        fixed("use after free after an exception") + f" ({returncode}) {output}"
    )


def test_terminate_after_a_failed_step_crashes_once_garbage_is_collected(build):
    sequence = ["exit", "step", "collect garbage", "terminate"]
    returncode, output = in_subprocess(play, str(build("FailsInStep")), sequence)
    assert returncode == SEGMENTATION_FAULT, (
        fixed("use after free after an exception") + f" ({returncode}) {output}"
    )


def test_second_failed_step_then_reading_crashes(build):
    returncode, output = in_subprocess(
        play, str(build("FailsInStep")), ["exit", "step", "step", "get"]
    )
    assert returncode == SEGMENTATION_FAULT, (
        fixed("double release after an exception") + f" ({returncode}) {output}"
    )


def test_unknown_value_reference_is_fatal_and_crashes_later(build):
    sequence = ["exit", "get unknown", "collect garbage", "get"]
    returncode, output = in_subprocess(play, str(build("Sound")), sequence)
    assert returncode == SEGMENTATION_FAULT, (
        fixed("unknown value references") + f" ({returncode}) {output}"
    )


def test_exception_at_the_end_of_initialization_does_not_stop_stepping(build):
    returncode, answers = in_subprocess(play, str(build("FailsInExit")), ["exit", "step", "free"])
    assert (returncode, answers) == (0, [FATAL, None, None]), fixed(
        "stepping an instance whose initialization failed"
    )


def test_exception_at_the_end_of_initialization_crashes_once_garbage_is_collected(build):
    sequence = ["exit", "collect garbage", "step"]
    returncode, output = in_subprocess(play, str(build("FailsInExit")), sequence)
    assert returncode == SEGMENTATION_FAULT, (
        fixed("use after free after an exception") + f" ({returncode}) {output}"
    )


def test_exception_in_the_constructor_is_a_clean_refusal(build):
    # Not a hazard in 0.7.0: no instance, and the process lives.
    returncode, instantiated = in_subprocess(try_to_instantiate, str(build("FailsInInit")))
    assert (returncode, instantiated) == (0, False)


def test_reset_after_a_failed_step_and_freeing_work(build):
    # Not a hazard in 0.7.0: reset builds a new object, free does not touch the old one's pointer
    # again.
    sequence = ["exit", "step", "collect garbage", "reset", "free"]
    returncode, answers = in_subprocess(play, str(build("FailsInStep")), sequence)
    assert returncode == 0, answers


def test_another_instance_survives_a_failure(build):
    # Not a hazard in 0.7.0.
    returncode, value = in_subprocess(
        fail_beside_another, str(build("FailsInStep")), str(build("Sound"))
    )
    assert returncode == 0, value
    assert value == pytest.approx(0.1)


def test_message_of_an_exception_is_lost_unless_logging_is_on(build):
    silent = finish_in_subprocess(play, str(build("FailsInStep")), ["exit", "step"])
    told = finish_in_subprocess(play, str(build("FailsInStep")), ["exit", "step"], True)
    assert "bad step" in told.output
    assert "bad step" not in silent.output, fixed("lost messages")


def test_percent_in_a_message_is_a_format(build):
    # A literal text handed to the printf-like logger as its format.
    finished = finish_in_subprocess(play, str(build("FailsWithPercent")), ["exit", "step"], True)
    assert finished.returncode == SEGMENTATION_FAULT, (
        fixed("messages with %") + f" ({finished.returncode})"
    )


# --- wrong results without a word
# -----------------------------------------------------------------------------------


def test_return_false_truncates_a_simulation_silently(build):
    returncode, times = in_subprocess(simulate, str(build("Discards")))
    assert returncode == 0, fixed("fmpy's handling of a discarded step") + f" {times}"
    assert times[-1] == pytest.approx(0.5), fixed("fmi2Discard for `return False`")


def test_two_fmus_with_modules_of_one_name_share_code(tmp_path):
    slow = hosts.build_pythonfmu(tmp_path / "a", "twin", source("Twin", in_step="self.x = 1.0"))
    fast = hosts.build_pythonfmu(tmp_path / "b", "twin", source("Twin", in_step="self.x = 2.0"))
    returncode, values = in_subprocess(step_both, str(slow), str(fast))
    assert returncode == 0
    assert values == (1.0, 1.0), fixed("shared modules")


def test_nan_input_negative_step_and_wrong_time_are_accepted(build):
    returncode, results = in_subprocess(abuse, str(build("Sound")))
    assert returncode == 0, fixed("argument checks") + f" {results}"
    assert math.isnan(results["nan"]), fixed("NaN inputs")
    assert results["negative step"] == pytest.approx(-0.1), fixed("negative steps")
    assert results["wrong time"] == pytest.approx(0.1), fixed(
        "communication points that do not follow"
    )


def test_saved_state_lacks_undeclared_attributes(tmp_path):
    fmu = hosts.build_pythonfmu(tmp_path, "hides", SOURCES["Hides"], canGetAndSetFMUstate=True)
    returncode, values = in_subprocess(save_and_restore, str(fmu))
    assert returncode == 0
    assert values == (2.0, 3.0), fixed("the saved state")


def test_wrong_guid_is_accepted(build):
    assert in_subprocess(try_to_instantiate, str(build("Sound")), None, "not-the-guid") == (
        0,
        True,
    ), fixed("GUID")


# --- loading, description, leaks
# ------------------------------------------------------------------------------------


def test_binary_does_not_load_without_python(build):
    with pytest.raises(hosts.HostError) as caught:
        hosts.run_c_host(build("Sound"), [0.0, 0.1], {"u": 1.0}, ["x"])
    assert caught.value.returncode == 2
    assert "undefined symbol: " in caught.value.output, fixed("loading in a host without Python")


@pytest.mark.parametrize("name", ["größe", "a+b#c"])
def test_folder_that_needs_percent_encoding_crashes_instantiation(build, tmp_path, name):
    # Only %20 of the resource URI is decoded; the module is then not found, and the missing class
    # is called.
    folder = str(tmp_path / name)
    returncode, output = in_subprocess(try_to_instantiate, str(build("Sound")), folder)
    assert returncode == SEGMENTATION_FAULT, (
        fixed("decoding of the resource location") + f" ({returncode}) {output}"
    )


def test_folder_that_needs_percent_encoding_is_no_trouble_for_fmpy(tmp_path):
    yardstick = str(hosts.build_one_state_fmu(tmp_path))
    assert in_subprocess(try_to_instantiate, yardstick, str(tmp_path / "größe")) == (0, True)


def test_model_description_is_invalid(build):
    from fmpy.validation import validate_fmu

    problems = validate_fmu(str(build("Sound")))
    assert len(problems) == 1, fixed("InitialUnknowns")
    assert "InitialUnknowns" in problems[0], fixed("InitialUnknowns")


def test_model_description_cannot_have_units(build):
    from pythonfmu import Real

    with zipfile.ZipFile(build("Sound")) as archive:
        assert b"UnitDefinitions" not in archive.read("modelDescription.xml"), fixed("units")
    with pytest.raises(TypeError, match="unit"):
        Real("u", unit="V")


def test_two_builds_of_one_source_differ(tmp_path):
    import fmpy

    guids = [
        fmpy.read_model_description(
            str(hosts.build_pythonfmu(tmp_path / copy, "sound", SOURCES["Sound"])), validate=False
        ).guid
        for copy in ("a", "b")
    ]
    assert guids[0] != guids[1], fixed("reproducible builds")


def test_every_instance_leaks_memory_and_a_path_entry(build, tmp_path):
    stock = in_subprocess(grow, str(build("Sound")), 400)
    yardstick = in_subprocess(grow, str(hosts.build_one_state_fmu(tmp_path)), 400)
    assert stock[0] == yardstick[0] == 0
    assert yardstick[1][0] < 0.5, "fmpy itself must not leak for this comparison"
    assert stock[1][0] > 4.0, fixed("the leak of about 9 KiB per instance")
    assert stock[1][1] == 1.0, fixed("the growing sys.path")
