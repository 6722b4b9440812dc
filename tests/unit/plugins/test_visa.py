"""VISA backend on instruments that pyvisa-sim emulates: messages of a calibration, and answers."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import pyvisa

from fmus.kit.errors import UserError
from fmus.kit.registry import presets
from orchestration.rig.backends.backend import Backend
from orchestration.rig.backends.registry import device_names, open_backend
from tests.support import source

LIBRARY = f"{source.ROOT / 'tests' / 'support' / 'rig' / 'instruments.yaml'}@sim"
PRESET = presets()["thesis_generator"].read_text(encoding="utf-8")


def opened(calibration: Path | str = "thesis_generator") -> Backend:
    return open_backend("visa", {"calibration": str(calibration), "library": LIBRARY})


@pytest.fixture
def rig() -> Iterator[Backend]:
    backend = opened()
    yield backend
    backend.close()


def changed(folder: Path, *changes: tuple[str, str]) -> Path:
    text = PRESET
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "instruments.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_its_devices_are_the_resources_of_the_instruments() -> None:
    named = (
        "VISA resource GPIB0::22::INSTR",
        "VISA resource USB0::0X0957::0X0407::MY44000000::INSTR",
    )
    assert device_names("visa", {}) == named
    assert device_names("visa", {"calibration": "thesis_generator", "library": LIBRARY}) == named


def offset(rig: Backend) -> float:
    return float(rig._sessions["generator"].query("VOLT:OFFS?"))  # type: ignore[attr-defined]


def test_the_generator_puts_out_what_is_commanded(rig: Backend) -> None:
    assert offset(rig) == 0.0  # opening has switched it to DC, zero
    rig.write({"current": 0.75})
    assert offset(rig) == 0.75
    assert dict(rig.read()) == {"voltage": 0.4375}
    assert rig.inputs == {"current": "A"}
    assert (rig.limits["current"].min, rig.limits["current"].max) == (-1.3, 1.3)


def test_the_generator_says_what_it_has(rig: Backend) -> None:
    rig.write({"current": 0.5})
    assert dict(rig.read_back()) == {"current": 0.5}
    rig._sessions["generator"].write("VOLT:OFFS 0.1")  # type: ignore[attr-defined]
    assert dict(rig.read_back()) == {"current": 0.1}, "by somebody at its front panel"


def test_what_has_not_changed_is_not_sent_again(rig: Backend) -> None:
    rig.write({"current": 0.5})
    rig._sessions["generator"].write("VOLT:OFFS 0.1")  # type: ignore[attr-defined]
    rig.write({"current": 0.5})
    assert offset(rig) == 0.1
    rig.safe()
    assert offset(rig) == 0.0
    rig.write({"current": 0.5})  # after a safe state it is
    assert offset(rig) == 0.5


def test_safe_and_close_work_at_any_time_and_twice() -> None:
    rig = opened()
    rig.safe()
    rig.safe()
    assert offset(rig) == 0.0
    rig.close()
    rig.safe()
    rig.close()
    with pytest.raises(UserError, match="generator: is closed"):
        rig.write({"current": 0.5})


def test_an_error_that_the_instrument_reports_is_told(rig: Backend) -> None:
    with pytest.raises(UserError, match=r'generator: reports -113,"Undefined header"'):
        rig.write({"current": -1.25})  # this generator takes -1.2 V at least
    rig.write({"current": -1.0})  # the error is not told twice
    assert offset(rig) == -1.0


def test_old_errors_are_told_once_and_then_gone(rig: Backend) -> None:
    for message in ("NONSENSE", "MORE NONSENSE"):
        rig._sessions["generator"].write(message)  # type: ignore[attr-defined]
    with pytest.raises(UserError, match="generator: reports -113"):
        rig.write({"current": 0.25})
    rig.write({"current": 0.5})
    assert offset(rig) == 0.5


def test_what_is_beyond_the_range_is_not_sent(rig: Backend) -> None:
    rig.write({"current": 0.5})
    with pytest.raises(
        UserError, match=r"current = 1.5 A: the range of generator allows -1.3 … 1.3 A only"
    ):
        rig.write({"current": 1.5})
    assert offset(rig) == 0.5


def test_an_overload_is_no_value(tmp_path: Path) -> None:
    rig = opened(changed(tmp_path, ("READ?", "OVERLOAD?")))
    assert math.isnan(rig.read()["voltage"])
    rig.close()


def test_an_answer_that_is_no_number_is_told(tmp_path: Path) -> None:
    rig = opened(changed(tmp_path, ("READ?", "WORDS?")))
    with pytest.raises(
        UserError, match="multimeter: answers 'BUSY' to WORDS\\?, which is no number"
    ):
        rig.read()
    rig.close()


def test_an_instrument_that_does_not_answer_is_waited_for_no_longer_than_its_timeout(
    tmp_path: Path,
) -> None:
    rig = opened(changed(tmp_path, ("READ?", "SILENT?"), ("timeout = 0.9", "timeout = 0.2")))
    assert rig._sessions["multimeter"].timeout == 200  # type: ignore[attr-defined]
    began = time.monotonic()
    with pytest.raises(UserError, match=r"multimeter: no answer to SILENT\?: VI_ERROR_TMO"):
        rig.read()
    assert time.monotonic() - began < 0.2 + 1.0  # a second for a busy machine
    rig.safe()
    rig.close()


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("NOWHERE::1", r"^backend visa: multimeter \(NOWHERE::1\) cannot be opened: [^\n]*$"),
        ("GPIB0::23::INSTR", r"^backend visa: multimeter: no answer to SYST:ERR\?: [^\n]*$"),
    ],
)
def test_an_instrument_that_is_not_there_is_told_and_the_others_are_let_go(
    tmp_path: Path, address: str, message: str
) -> None:
    with pytest.raises(UserError, match=message):
        opened(changed(tmp_path, ("GPIB0::22::INSTR", address)))
    opened().close()


def test_a_setup_that_is_refused_is_told(tmp_path: Path) -> None:
    path = changed(tmp_path, ('"FUNC DC"', '"FUNC SAWTOOTH"'))
    with pytest.raises(UserError, match="backend visa: generator: reports -113"):
        opened(path)


def test_a_calibration_of_a_device_is_not_one_of_instruments() -> None:
    with pytest.raises(
        UserError, match="thesis: current is a channel of a device, not of an instrument"
    ):
        opened("thesis")


def test_without_a_library_it_says_so() -> None:
    with pytest.raises(UserError, match=r"backend visa: no VISA library: .*library=@py"):
        open_backend("visa", {"library": "/nowhere/libvisa.so"})


def test_after_a_failed_message_safe_tries_again(
    rig: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig.write({"current": 0.5})
    session = rig._sessions["generator"]  # type: ignore[attr-defined]
    send, failures = session.write, [1]

    def flaky(message: str) -> int:
        if failures:
            failures.pop()
            raise pyvisa.errors.VisaIOError(-1073807339)
        return int(send(message))

    monkeypatch.setattr(session, "write", flaky)
    rig.safe()
    assert offset(rig) == 0.0
