"""Replay backend: a record is given back row by row at its own pace, in SI, holes as holes."""

from __future__ import annotations

import math
import time
from pathlib import Path

import pytest

from fmus.kit.errors import UserError
from orchestration.rig.backends.replay import Replay

FILE = """time [s],current [mA],force [N],voltage [mV],displacement [mm],bath [degC]
5.0,100,1.0,10,0.1,20
5.5,200,1.0,20,,21
6.0,300,1.0,30,0.3,22
6.5,400,1.0,40,0.4,23
"""


@pytest.fixture
def file(tmp_path: Path) -> str:
    path = tmp_path / "run.csv"
    path.write_text(FILE, encoding="utf-8")
    return str(path)


def voltages(rig: Replay, step: float, count: int) -> list[float]:
    found = [rig.read()["voltage"]]
    for _ in range(count):
        rig.advance(step)
        found.append(rig.read()["voltage"])
    return found


def test_rows_come_when_it_is_their_time(file: str) -> None:
    rig = Replay(file)
    assert dict(rig.inputs) == {"current": "A", "force": "N"}
    assert dict(rig.outputs) == {"voltage": "V", "displacement": "m"}
    assert rig.read() == {"voltage": pytest.approx(0.01), "displacement": pytest.approx(1e-4)}
    assert voltages(rig, 0.25, 5) == pytest.approx([0.01, 0.01, 0.02, 0.02, 0.03, 0.03])


def test_rounding_of_many_steps_does_not_show_the_row_before(file: str) -> None:
    rig = Replay(file)
    for _ in range(10):
        rig.advance(0.1)
    assert sum([0.1] * 10) < 1.0
    assert rig.read()["voltage"] == pytest.approx(0.03)


def test_a_hole_is_no_value(file: str) -> None:
    rig = Replay(file)
    rig.advance(0.5)
    assert math.isnan(rig.read()["displacement"])


@pytest.mark.parametrize(
    ("at_end", "expected"),
    [
        ("hold", [0.01, 0.02, 0.03, 0.04, 0.04, 0.04]),
        ("loop", [0.01, 0.02, 0.03, 0.04, 0.01, 0.02]),
    ],
)
def test_at_its_end_it_goes_on_as_asked(file: str, at_end: str, expected: list[float]) -> None:
    assert voltages(Replay(file, at_end=at_end), 0.5, 5) == pytest.approx(expected)


def test_at_its_end_it_fails_if_asked(file: str) -> None:
    rig = Replay(file, at_end="fail")
    rig.advance(1.9)
    assert rig.read()["voltage"] == pytest.approx(0.04)
    rig.advance(0.1)
    with pytest.raises(UserError, match="the record is at its end after 2 s"):
        rig.read()


def test_in_real_time_it_starts_with_the_first_command(file: str) -> None:
    rig = Replay(file)
    time.sleep(0.05)
    assert rig.read()["voltage"] == pytest.approx(0.01)
    began = time.monotonic()
    rig.write({"current": 0.0, "force": 0.0})
    while rig.read()["voltage"] < 0.015:
        assert time.monotonic() - began < 5.0
        time.sleep(0.005)
    assert time.monotonic() - began >= 0.499


def test_inputs_and_outputs_can_be_chosen(file: str) -> None:
    rig = Replay(file, inputs="force", outputs="bath[K], voltage")
    assert dict(rig.inputs) == {"force": "N"}
    assert rig.outputs == {"bath": "K", "voltage": "V"}
    assert rig.read()["bath"] == pytest.approx(293.15)
    rig.write({"force": 1.0})
    for _ in range(2):
        rig.safe()
        rig.close()


def test_columns_of_other_names_are_mapped(file: str) -> None:
    rig = Replay(file, outputs="temperature[K]", map="bath=temperature")
    assert rig.read() == {"temperature": pytest.approx(293.15)}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"at_end": "stop"}, "option at_end = 'stop'"),
        (
            {"outputs": "bath"},
            r"option outputs: bath is not known by name; write its SI unit: bath\[K\]",
        ),
        ({"outputs": "charge"}, "charge"),
        ({"outputs": ","}, "option outputs = ',': names no signal"),
        ({"outputs": "bath[Q]"}, "unknown unit 'Q'"),
        ({"signals": "bench", "outputs": "coil_voltage"}, "coil_voltage"),
    ],
)
def test_what_cannot_be_replayed_is_told(file: str, options: dict[str, str], message: str) -> None:
    with pytest.raises(UserError, match=message):
        Replay(file, **options)


def test_a_file_without_any_output_is_told(tmp_path: Path) -> None:
    path = tmp_path / "bare.csv"
    path.write_text("time [s],current [A]\n0,1\n1,2\n", encoding="utf-8")
    with pytest.raises(UserError, match="has none of the outputs voltage, displacement"):
        Replay(str(path))


def test_a_step_that_is_none_is_refused(file: str) -> None:
    with pytest.raises(UserError, match="must be from 0 to"):
        Replay(file).advance(-0.1)
