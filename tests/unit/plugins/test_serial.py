"""Serial backend at a pseudo-terminal: what an instrument there hears, and its answers."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

pytest.importorskip("termios", reason="a pseudo-terminal needs POSIX")

from fmus.kit.errors import UserError
from orchestration.rig.backends import Backend, device_names, open_backend
from tests.support.rig.wires import CALIBRATION, Instrument


@pytest.fixture
def supply() -> Iterator[Instrument]:
    with Instrument() as one:
        yield one


@pytest.fixture
def calibration(tmp_path: Path, supply: Instrument) -> Callable[..., dict[str, str]]:
    """Write the file with changes to its text, and return the options of the backend."""

    def write(*changes: tuple[str, str], port: str | None = None) -> dict[str, str]:
        text = CALIBRATION.format(port=port or supply.port)
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "supply.toml"
        path.write_text(text, encoding="utf-8")
        return {"calibration": str(path)}

    return write


@pytest.fixture
def rig(calibration: Callable[..., dict[str, str]]) -> Iterator[Backend]:
    backend = open_backend("serial", calibration())
    yield backend
    backend.close()


def test_a_command_is_a_line_and_values_are_found_in_answers(
    rig: Backend, supply: Instrument
) -> None:
    assert supply.heard == ["CURR 0"]  # its setup
    rig.write({"current": 1.5})
    assert supply.heard[1:] == ["CURR 0.750000"]  # 2 A a unit
    assert dict(rig.read_back()) == {"current": 1.5}
    assert dict(rig.read()) == {"temperature": pytest.approx(294.65)}
    assert rig.outputs == {"temperature": "K"}
    assert (rig.limits["current"].min, rig.limits["current"].max) == (-2.0, 2.0)


def test_the_safe_value_is_sent_at_any_time(rig: Backend, supply: Instrument) -> None:
    rig.write({"current": 1.5})
    rig.safe()
    rig.safe()
    assert supply.current == 0.05
    assert rig.safe_values == {"current": 0.1}
    rig.close()
    rig.safe()
    with pytest.raises(UserError, match="supply: is closed"):
        rig.read()


def test_a_reply_that_refuses_a_command_is_told(rig: Backend) -> None:
    with pytest.raises(UserError, match=r"supply: replies 'ERROR' to CURR 1.200000; wanted is OK"):
        rig.write({"current": 2.4})


def test_an_answer_that_came_too_late_is_not_that_of_the_next_message(
    rig: Backend, supply: Instrument
) -> None:
    supply.send(b"T1=+99.00 C\r\n")
    time.sleep(0.05)
    assert dict(rig.read()) == {"temperature": pytest.approx(294.65)}


@pytest.mark.parametrize("answer", [b"", b"T1=+21.50 C"], ids=["silence", "no end of the line"])
def test_an_answer_without_an_end_is_waited_for_no_longer_than_its_timeout(
    rig: Backend, supply: Instrument, answer: bytes
) -> None:
    supply.answer = {"TEMP?": answer}
    began = time.monotonic()
    with pytest.raises(UserError, match=r"supply: no answer to TEMP\?: b'.*' within 0.2 s"):
        rig.read()
    assert time.monotonic() - began < 2 * 0.2 + 0.5  # half a second for a busy machine


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        (b"BUSY\r\n", r"supply: answers 'BUSY' to TEMP\?, which is no number"),
        (b"\xff\xfe C\r\n", r"supply: no answer to TEMP\?: .*can't decode byte 0xff"),
    ],
)
def test_an_answer_without_a_number_is_told(
    rig: Backend, supply: Instrument, answer: bytes, reason: str
) -> None:
    supply.answer = {"TEMP?": answer}
    with pytest.raises(UserError, match=reason):
        rig.read()


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("baudrate = 115200", "", "its baudrate is missing"),
        ("baudrate = 115200", "baudrate = 9.6", "baudrate = 9.6: a whole number above 0 is wanted"),
        ("timeout = 0.2", "timeout = 0.5", "timeout = 0.5: must be below the watchdog, 0.5 s"),
        ("reply = ", "framing = '9X1'\nreply = ", "framing = '9X1': data bits, parity"),
        (r"'([-+.\d]+)", r"'[-+.\d]+", "one group in parentheses is wanted"),
        ("'([-+.", "'(([-+.", "a valid regular expression is wanted"),
    ],
)
def test_what_is_wrong_in_the_file_is_told(
    calibration: Callable[..., dict[str, str]], old: str, new: str, reason: str
) -> None:
    with pytest.raises(UserError, match=reason) as caught:
        open_backend("serial", calibration((old, new)))
    assert "\n" not in str(caught.value)


def test_a_port_that_is_not_there_is_told(calibration: Callable[..., dict[str, str]]) -> None:
    with pytest.raises(UserError, match=r"^backend serial: supply \(/dev/none\) cannot be opened"):
        open_backend("serial", calibration(port="/dev/none"))


def test_a_port_has_one_name_whatever_link_leads_to_it(
    calibration: Callable[..., dict[str, str]], supply: Instrument, tmp_path: Path
) -> None:
    link = tmp_path / "by-id"
    link.symlink_to(supply.port)
    named = device_names("serial", calibration())
    assert named == device_names("serial", calibration(port=str(link)))
    assert len(named) == 1
