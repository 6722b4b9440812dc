"""Base of instruments on a line of the tests' own: what is sent, in what order, how often."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from fmus.kit.errors import UserError
from orchestration.plugins.messages import Instruments

FILE = """
[rig]
rate = 10.0
watchdog = 0.5
[instruments.supply]
resource = "here"
timeout = {timeout}
setup = ["RESET"]
safe = ["OFF"]
{more}
[inputs.current]
instrument = "supply"
write = "I {{volts:g}}"
gain = 1.0
unit = "A"
range = [-1.0, 1.0]
date = 2026-11-29
[outputs.voltage]
instrument = "supply"
query = "U?"
gain = 1.0
unit = "V"
range = [-1.0, 1.0]
date = 2026-11-29
"""


class Line:
    """A line whose answers are in a table; None of them is an error of the line."""

    def __init__(self, answers: dict[str, str | None]) -> None:
        self.answers = answers
        self.sent: list[str] = []

    def write(self, message: str) -> None:
        self.sent.append(message)

    def query(self, message: str) -> str:
        self.sent.append(message)
        answer = self.answers.get(message)
        if answer is None:
            raise TimeoutError("nothing")
        return answer

    def clear(self) -> None:
        self.sent.append("(clear)")

    def close(self) -> None:
        self.sent.append("(close)")


def rig(
    folder: Path, more: str = "", timeout: str = "0.1", **answers: Any
) -> tuple[Instruments, Line]:
    """Return a rig of one instrument, and the line to it."""
    path = folder / "supply.toml"
    path.write_text(FILE.format(more=more, timeout=timeout))
    line = Line({"U?": "0.5", **answers})

    class Made(Instruments):
        def _connect(self, instrument: Any) -> Line:
            return line

    return Made(str(path)), line


def test_a_command_is_sent_when_it_has_changed(tmp_path: Path) -> None:
    supply, line = rig(tmp_path)
    for value in (0.5, 0.5, -0.25):
        supply.write({"current": value})
    assert line.sent == ["RESET", "I 0.5", "I -0.25"]
    supply.safe()
    supply.write({"current": -0.25})
    assert line.sent[3:] == ["I 0", "OFF", "I -0.25"]


def test_each_command_has_its_reply(tmp_path: Path) -> None:
    replies = {"RESET": "OK", "I 0": "OK", "OFF": "OK 1", "I 0.5": "NO"}
    supply, line = rig(tmp_path, 'reply = "OK.*"', **replies)
    supply.safe()
    with pytest.raises(UserError, match=r"supply: replies 'NO' to I 0.5; wanted is OK\.\*"):
        supply.write({"current": 0.5})
    line.answers["I 0"] = None
    line.sent.clear()
    with pytest.raises(UserError, match="supply: no answer to I 0: nothing"):
        supply.safe()
    assert line.sent == ["I 0", "(clear)", "I 0", "OFF"]


@pytest.mark.parametrize(
    ("more", "answer", "value"),
    [
        ("", "0.25,V", 0.25),
        ("answer = 'U=(\\S+)'", "I=0.1 U=-0.75 V", -0.75),
    ],
)
def test_a_number_is_found_in_an_answer(
    tmp_path: Path, more: str, answer: str, value: float
) -> None:
    supply, _ = rig(tmp_path, more, **{"U?": answer})
    assert supply.read() == {"voltage": value}


def test_an_answer_without_the_number_is_told(tmp_path: Path) -> None:
    supply, _ = rig(tmp_path, "answer = 'U=(\\S+)'", **{"U?": "0.5"})
    with pytest.raises(UserError, match=r"supply: answers '0.5' to U\?, which is no number"):
        supply.read()


def test_a_timeout_has_to_be_below_the_watchdog(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"\[instruments.supply\] timeout = 0.5: must be below"):
        rig(tmp_path, timeout="0.5")


def test_closing_leaves_the_instrument_as_it_is(tmp_path: Path) -> None:
    supply, line = rig(tmp_path)
    supply.close()
    supply.close()
    supply.safe()
    assert line.sent == ["RESET", "(close)"]
