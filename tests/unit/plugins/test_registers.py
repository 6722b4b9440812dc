"""Places of Modbus: words of registers against those of `struct`."""

from __future__ import annotations

import datetime
import struct
from types import SimpleNamespace

import pytest

from fmus.kit.errors import UserError
from orchestration.plugins.calibration import Channel
from orchestration.plugins.registers import Place


def channel(place: str, low: float = -100.0, high: float = 100.0) -> Channel:
    return Channel(
        name="current",
        unit="A",
        si="A",
        channel=place,
        range=(low, high),
        date=datetime.date(2026, 11, 29),
    )


@pytest.mark.parametrize(
    ("kind", "form", "number"),
    [
        ("int16", "h", -250),
        ("uint16", "H", 40000),
        ("int32", "i", -70000),
        ("uint32", "I", 3_000_000_000),
        ("int64", "q", -(2**40)),
        ("uint64", "Q", 2**40),
        ("float32", "f", 0.75),
        ("float64", "d", 0.1),
    ],
)
@pytest.mark.parametrize("order", ["", " little"])
def test_words_are_those_of_the_type(kind: str, form: str, number: float, order: str) -> None:
    packed = struct.pack(f">{form}", number)
    words = list(struct.unpack(f">{len(packed) // 2}H", packed))
    if order:
        words.reverse()
    place = Place(channel(f"holding 4 {kind}{order}"))
    assert (place.address, place.count) == (4, len(words))
    assert place.encode(float(number)) == words
    assert place.decode(SimpleNamespace(registers=words)) == number


def test_whole_numbers_are_rounded_and_bits_are_halves() -> None:
    assert Place(channel("holding 4 int16")).encode(2.6) == [3]
    bit = Place(channel("coil 3"), written=True)
    assert (bit.encode(0.49), bit.encode(1.0)) == ([False], [True])
    assert bit.decode(SimpleNamespace(bits=[True, False])) == 1.0


@pytest.mark.parametrize(
    ("place", "written", "reason"),
    [
        ("input 0 int16", True, "channel = 'input 0 int16': coil or holding is wanted"),
        ("discrete 0", True, "coil or holding is wanted"),
        ("holding 0", False, "of registers a type of int16, uint16"),
        ("coil 1 int16", False, "'coil 1 int16': coil or discrete or holding or input"),
        ("coil 1 little", False, "'coil 1 little': coil or"),
        ("table 0 int16", False, "coil or discrete or holding or input is wanted"),
        ("holding x int16", False, "'holding x int16'"),
        ("holding 100000 int16", False, "'holding 100000 int16'"),
        ("holding 70000 int16", False, "'holding 70000 int16'"),
        ("ai0", False, "'ai0'"),
    ],
)
def test_a_channel_that_is_no_place_is_told(place: str, written: bool, reason: str) -> None:
    with pytest.raises(UserError, match=f"^current: .*{reason}") as caught:
        Place(channel(place), written=written)
    assert "\n" not in str(caught.value)


def test_a_range_that_its_registers_do_not_hold_is_told() -> None:
    with pytest.raises(UserError, match="current: 40000 is beyond what holding 0 int16 holds"):
        Place(channel("holding 0 int16", 0.0, 4e4), written=True)
    with pytest.raises(UserError, match=r"current: 1e\+39 is beyond what holding 0 float32 holds"):
        Place(channel("holding 0 float32", 0.0, 1e39), written=True)
    Place(channel("holding 0 int16", 0.0, 4e4))  # what is measured cannot be too large
