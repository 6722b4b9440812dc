"""The contract for proxies, line by line; what a live rig cannot give is declared and refused.

Most of it is tested at a small rig that shares no code with the project; where nothing is said of
one, there is none.
"""

from __future__ import annotations

import re
import sys
import time
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import pytest
from fmpy.validation import validate_fmu

from fmus import PROXIES, component
from fmus.kit.build.building import build
from fmus.kit.build.toolchain import host_platform
from tests.contract import leaks, structure
from tests.contract.raw import ERROR, OK, doubles, instance, references, resident
from tests.support import hosts
from tests.support.rig.proxies import actuator_rig, answered, connected, get_text, set_text

CANNOT = {
    2: {
        "canGetAndSetFMUstate",
        "canSerializeFMUstate",
        "providesDirectionalDerivative",
        "canInterpolateInputs",
    },
    3: {
        "canGetAndSetFMUState",
        "canSerializeFMUState",
        "providesDirectionalDerivatives",
        "providesAdjointDerivatives",
        "mightReturnEarlyFromDoStep",
    },
}


@pytest.fixture(params=[2, 3], ids=["FMI 2.0", "FMI 3.0"])
def fmi(request) -> int:
    return request.param


@pytest.fixture
def rig_proxy(fmu, runtime, fmi) -> Path:
    return fmu("rig_proxy", runtime, fmi)


@pytest.fixture(params=PROXIES)
def proxy(request, fmu, runtime, fmi) -> Path:
    return fmu(request.param, runtime, fmi)


@pytest.fixture
def one(rig_proxy):
    with instance(rig_proxy) as created:
        yield created


# --- lines 1 to 3: the description
# ----------------------------------------------------------------------------------


def test_the_description_is_valid_and_lists_every_unknown(proxy):
    assert validate_fmu(str(proxy)) == []
    structure.every_unknown_is_listed(proxy)


def test_every_variable_has_a_description_and_numbers_have_units(proxy, fmi):
    root = ElementTree.fromstring(zipfile.ZipFile(proxy).read("modelDescription.xml"))
    texts = set()
    for variable in root.find("ModelVariables"):
        assert len(variable.attrib["description"]) > 5
        typed = variable[0] if fmi == 2 else variable
        kind = typed.tag
        assert kind not in ("Real", "Float64") or typed.attrib["unit"]
        texts |= {variable.attrib["name"]} if kind == "String" else set()
    assert texts == {"endpoint", "credentials", "on_stale"}


def test_two_builds_are_the_same_bytes(rig_proxy, runtime, fmi):
    again = build(component("rig_proxy"), runtime, [host_platform()], fmi=fmi)
    assert again == rig_proxy.read_bytes()


# --- line 4: no call hangs or crashes
# -------------------------------------------------------------------------------


@pytest.mark.real_time
def test_without_a_rig_initialization_fails_in_time_and_says_what_to_do(one):
    assert set_text(one, "endpoint", "tcp://127.0.0.1:9") == OK
    one.set({"communication_timeout": 0.3})
    one.do("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
    one.do("fmi2EnterInitializationMode")
    begin = time.monotonic()
    assert one.call("fmi2ExitInitializationMode") == ERROR
    assert time.monotonic() - begin < 1.3
    assert re.search(r"tcp://127.0.0.1:9.*ppy rig serve", one.messages[-1]), one.messages
    with actuator_rig() as rig:
        one.do("fmi2Reset")
        connected(one, rig).step(0.01)
        one.do("fmi2Terminate")


@pytest.mark.parametrize(
    "endpoint",
    [
        "",
        "nonsense",
        "tcp://",
        "tcp://127.0.0.1",
        "tcp://127.0.0.1:",
        "tcp://127.0.0.1:99999",
        "tcp://:::::",
        "udp://127.0.0.1:5570",
        "tcp://127.0.0.1:1e3",
        "tcp://127.0.0.1:5570extra",
    ],
)
def test_an_endpoint_that_is_none_is_named(one, endpoint):
    assert set_text(one, "endpoint", endpoint) == OK
    one.set({"communication_timeout": 0.2})
    one.do("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
    one.do("fmi2EnterInitializationMode")
    assert one.call("fmi2ExitInitializationMode") == ERROR
    assert endpoint in one.messages[-1]
    assert len(one.messages[-1]) < 300


def test_texts_are_guarded(one, fmi):
    reference, other = one.variables["endpoint"][0], one.variables["max_age"][0]
    # before initialization, FMI 3.0 has start values read
    assert get_text_status(one, reference) == (ERROR if fmi == 2 else OK)
    assert set_text(one, "endpoint", "x" * 511) == OK
    assert set_text(one, "endpoint", "x" * 512) == ERROR
    assert "511 are allowed" in one.messages[-1]
    assert set_text(one, "endpoint", None) == ERROR
    assert one.call("fmi2SetString", references(other), 1, doubles(0.0)) == ERROR
    assert one.call("fmi2SetReal", references(reference), 1, doubles(0.0)) == ERROR
    assert "'endpoint', which is of type String" in one.messages[-1]
    assert one.call("fmi2SetString", references(reference), 1, None) == ERROR
    assert one.call("fmi2SetString", references(10**6), 1, doubles(0.0)) == ERROR
    with actuator_rig() as rig:
        connected(one, rig)
        assert get_text(one, "endpoint") == rig.endpoint
        assert set_text(one, "endpoint", "late") == ERROR
        assert "cannot be set after initialization" in one.messages[-1]


def get_text_status(one, reference: int) -> int:
    return one.call("fmi2GetString", references(reference), 1, doubles(0.0))


def test_bad_numbers_and_steps_are_refused_and_the_session_goes_on(one):
    with actuator_rig() as rig:
        connected(one, rig)
        cell = one.references(["current"])
        for bad in (float("nan"), float("inf")):
            assert one.call("fmi2SetReal", cell, 1, doubles(bad)) == ERROR
        for size in (-0.1, 0.0, float("nan"), float("inf")):
            assert one.call("fmi2DoStep", 0.0, size, 1) == ERROR
        one.set({"current": 1.0})
        answered(one, voltage=0.6)


def test_a_step_longer_than_the_timeout_is_refused_at_once(one):
    with actuator_rig() as rig:
        connected(one, rig, {"communication_timeout": 0.5})
        begin = time.monotonic()
        assert one.call("fmi2DoStep", 0.0, 10.0, 1) == ERROR
        assert time.monotonic() - begin < 0.5
        assert "10 s" in one.messages[-1]
        assert "communication_timeout" in one.messages[-1]


# --- lines 5 to 8
# --------------------------------------------------------------------------------------------------


def test_the_state_is_declared_unsupported_and_refused(proxy, one, fmi):
    root = ElementTree.fromstring(zipfile.ZipFile(proxy).read("modelDescription.xml"))
    cannot = {key for key, can in root.find("CoSimulation").attrib.items() if can == "false"}
    assert cannot >= CANNOT[fmi]
    assert one.call("fmi2GetFMUstate", doubles(0.0)) == ERROR
    assert one.call("fmi2SetFMUstate", None) == ERROR
    assert all("not supported by rig_proxy" in message for message in one.messages)


def test_two_proxies_in_one_process_each_see_their_own_rig(rig_proxy):
    with (
        actuator_rig() as first,
        actuator_rig() as second,
        instance(rig_proxy) as one,
        instance(rig_proxy) as other,
    ):
        connected(one, first), connected(other, second)
        for k in range(1, 6):
            one.set({"current": 0.1 * k})
            other.set({"current": -0.1 * k})
            one.step(0.05), other.step(0.05)
        answered(one, voltage=0.3), answered(other, voltage=-0.3)
        assert {m["client"] for m in first.of_type("connect")} == {"rig_proxy"}


def test_reset_ends_the_session_and_begins_anew(one):
    with actuator_rig() as rig:
        for current in (0.5, 1.0):
            connected(one, rig, {"current": current})
            assert one.get("missed_deadlines") == [0.0]
            answered(one, voltage=0.6 * current)
            one.do("fmi2Reset")
            assert rig.state == "idle"
        assert len(rig.of_type("disconnect")) == 2


def test_terminating_and_freeing_bring_the_rig_to_rest(rig_proxy):
    with actuator_rig() as rig:
        for end in ("fmi2Terminate", None):
            with instance(rig_proxy) as one:
                connected(one, rig, {"current": 1.0}).step(0.05)
                assert rig.state == "running"
                if end:
                    one.do(end)
                    assert rig.state == "idle"
            assert rig.state == "idle"


linux_only = pytest.mark.skipif(sys.platform != "linux", reason="memory is measured on Linux")


@pytest.mark.slow
@linux_only
def test_creating_and_freeing_leaks_nothing(rig_proxy):
    returncode, grown = hosts.in_subprocess(leaks.grow_by_creating, str(rig_proxy), 500)
    assert returncode == 0, grown
    assert grown < 0.5 * 500 * leaks.LEAST, f"{grown / 500:.0f} bytes per instance"


def grow_by_sessions(archive: str, sessions: int, steps: int) -> tuple[int, int]:
    """Bytes by which sessions, and steps within one, make the process grow."""
    with actuator_rig(mode="lockstep", period=1.0) as rig, instance(archive) as one:
        rig.publishes = False

        def run(count: int, each: int) -> int:
            before = resident()
            for _ in range(count):
                connected(one, rig, {"current": 1.0})
                for _ in range(each):
                    one.step(0.01)
                    rig.heard.clear()
                one.do("fmi2Reset")
            return resident() - before

        run(sessions, 3), run(3, steps // 3)
        return run(sessions, 3), run(3, steps // 3)


@pytest.mark.slow
@linux_only
def test_sessions_and_steps_leak_nothing(rig_proxy):
    returncode, grown = hosts.in_subprocess(grow_by_sessions, str(rig_proxy), 100, 6000)
    assert returncode == 0, grown
    by_sessions, by_steps = grown
    assert by_sessions < 0.5 * 2**20, f"{by_sessions / 100:.0f} bytes per session"
    assert by_steps < 0.3 * 2**20, f"{by_steps / 6000:.0f} bytes per step"


@pytest.mark.real_time
@pytest.mark.parametrize("sizes", [[0.02] * 5, [0.001] * 20, [0.09, 0.001, 0.03]], ids=len)
def test_any_step_ends_at_its_time_on_the_rigs_clock(one, sizes):
    with actuator_rig(period=0.001) as rig:
        connected(one, rig)
        begin = time.monotonic()
        passed = 0.0
        for size in sizes:
            one.step(size)
            passed += size
            taken, age = one.get("charge", "charge_age")  # the rig's clock, which is this machine's
            # not before the step ended, but for the age of the sample; late only by what a busy
            # machine adds
            assert passed - 0.005 - age < taken - begin < passed + 0.2
        assert [m["step"] for m in rig.of_type("exchange")][-1] == sizes[-1]


# --- lines 9 to 11
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("texts", "values", "said"),
    [
        ({"on_stale": "perhaps"}, {}, r"'on_stale' = '?perhaps'?.*hold.*fail"),
        ({}, {"deadline": 2.0}, r"'deadline' = 2 s.*communication_timeout"),
        ({}, {"max_age": 0.0}, r"'max_age' = 0 s is outside its range"),
        (
            {},
            {"communication_timeout": 1e3},
            r"'communication_timeout' = 1000 s is outside its range",
        ),
    ],
)
def test_invalid_parameters_are_refused(one, texts, values, said):
    with actuator_rig() as rig:
        for name, text in ({"endpoint": rig.endpoint} | texts).items():
            assert set_text(one, name, text) == OK
        one.set(values)
        one.do("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
        one.do("fmi2EnterInitializationMode")
        assert one.call("fmi2ExitInitializationMode") == ERROR
        assert re.search(said, " ".join(one.messages)), one.messages


def test_the_archive_tells_what_it_is_and_what_it_needs(proxy, runtime, fmi):
    files = {name: zipfile.ZipFile(proxy).read(name) for name in zipfile.ZipFile(proxy).namelist()}
    page = files["documentation/index.html"].decode()
    for word in ("endpoint", "on_stale", "max_age", "link_state", "tcp://127.0.0.1:5570"):
        assert word in page
    icon = "model.png" if fmi == 2 else "terminalsAndIcons/icon.png"
    assert {icon, "documentation/licenses/license.txt"} <= set(files)
    needs = files.get("documentation/externalDependencies.txt", b"").decode()
    assert ("pyzmq" in needs) == (runtime == "python")
    packed = [name for name in files if name.startswith("resources/python/")]
    assert bool(packed) == (runtime == "python")
    for name in packed:
        assert not re.search(
            rb"^\s*(import|from) (numpy|casadi|pint|orchestration)", files[name], re.M
        ), name
