"""Tests of calibrations: conversion to volts and back, and one line for every mistake in a file."""

from __future__ import annotations

import math
import re
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmus import PROXIES, component
from fmus.kit.errors import UserError
from fmus.kit.registry import presets
from orchestration.plugins.calibration import Calibration, Channel, read_calibration
from orchestration.rig.signals import Limit
from tests.support import source

GOOD = """
[rig]
rate = 30
watchdog = 0.2

[inputs.current]
channel = "ao1"
gain = 0.5
offset = 0.1
unit = "A"
range = [-2, 2.5]
date = 2007-05-01

[outputs.displacement]
channel = "ai1"
gain = 5.08
offset = -1.0
sign = -1
unit = "mm"
range = [0, 10]
date = 2007-05-01
source = "gauge blocks"

[outputs.temperature]
channel = "ai2"
gain = 10.0
unit = "degC"
si = "K"
range = [0, 10]
date = 2007-05-01

[limits.current]
min = -800
max = 800
rate = 5000
unit = "mA"

[limits.displacement]
max = 10
unit = "mm"
"""


def read(folder: Path, text: str) -> Calibration:
    path = folder / "rig.toml"
    path.write_text(text, encoding="utf-8")
    return read_calibration(str(path))


def test_volts_become_si(tmp_path: Path) -> None:
    rig = read(tmp_path, GOOD)
    assert rig.inputs["current"].volts(0.6) == pytest.approx(1.0)  # 0.5 * 1 + 0.1
    assert rig.outputs["displacement"].measured(2.0) == pytest.approx(
        -9.16e-3
    )  # -(5.08 * 2 - 1) mm
    assert rig.outputs["temperature"].measured(2.0) == pytest.approx(293.15)  # 20 degC
    assert {name: channel.si for name, channel in rig.outputs.items()} == {
        "displacement": "m",
        "temperature": "K",
    }
    assert (rig.limits["current"].min, rig.limits["current"].max, rig.limits["current"].rate) == (
        -0.8,
        0.8,
        5.0,
    )
    displacement = rig.limits["displacement"]
    assert (displacement.min, displacement.max, displacement.rate) == (-math.inf, 0.01, math.inf)
    assert "temperature" not in rig.limits
    assert (rig.rate, rig.watchdog) == (30.0, 0.2)
    assert rig.outputs["displacement"].source == "gauge blocks"
    assert rig.outputs["displacement"].date.isoformat() == "2007-05-01"


def test_volts_that_make_no_sense_are_no_value(tmp_path: Path) -> None:
    channel = read(tmp_path, GOOD).outputs["displacement"]
    assert [
        math.isnan(channel.measured(v)) for v in (-0.001, 0.0, 10.0, 10.001, math.nan, math.inf)
    ] == [
        True,
        False,
        False,
        True,
        True,
        True,
    ]


def test_a_command_beyond_the_range_is_refused(tmp_path: Path) -> None:
    channel = read(tmp_path, GOOD).inputs["current"]
    assert channel.volts(1.35) == 2.5
    for value in (1.36, -0.91, math.nan, math.inf):
        with pytest.raises(
            UserError, match=r"current = .* A: the range of ao1 allows -0.9 … 1.35 A only"
        ):
            channel.volts(value)


def test_limits_of_warning_are_those_of_a_measured_signal(tmp_path: Path) -> None:
    text = GOOD.replace("max = 10\n", "max = 10\nwarn = [2, 8]\n")
    limit = read(tmp_path, text).limits["displacement"]
    assert limit == Limit(max=0.01, warn_min=0.002, warn_max=0.008)
    kelvin = GOOD + "\n[limits.temperature]\nwarn = [10, 60]\n"
    assert read(tmp_path, kelvin).limits["temperature"] == Limit(
        warn_min=pytest.approx(283.15), warn_max=pytest.approx(333.15)
    )
    for old, message in (
        ("max = 800", r"\[limits.current\] warn = \[2, 8\]: is of a measured signal"),
        ("max = 10\n", r"\[limits.displacement\] warn = \[8, 2\]: \[low, high\] of two"),
    ):
        pair = "[2, 8]" if "current" in message else "[8, 2]"
        with pytest.raises(UserError, match=message):
            read(tmp_path, GOOD.replace(old, f"{old}\nwarn = {pair}\n"))


def test_without_limits_those_of_the_range_hold(tmp_path: Path) -> None:
    limit = read(tmp_path, GOOD.split("[limits")[0]).limits["current"]
    assert (limit.min, limit.max) == pytest.approx((-0.9, 1.35))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("rate = 30\n", "", "[rig] rate is missing: a finite number above 0 is wanted"),
        ("rate = 30\n", "rate = 0\n", "[rig] rate = 0: a finite number above 0 is wanted"),
        (
            "watchdog = 0.2",
            "watchdog = true",
            "[rig] watchdog = True: a finite number above 0 is wanted",
        ),
        (
            "rate = 30\n",
            "rate = 30\nrte = 3\n",
            "[rig] rte = 3: there is no such key (did you mean rate?)",
        ),
        ("gain = 0.5", 'gain = "0.5"', "[inputs.current] gain = '0.5': a finite number is wanted"),
        ("gain = 0.5", "gain = 0", "[inputs.current] gain = 0: must not be zero"),
        ("gain = 0.5", "gain = nan", "[inputs.current] gain = nan: a finite number is wanted"),
        ("gain = 0.5\n", "", "[inputs.current] gain is missing: a finite number is wanted"),
        (
            "range = [-2, 2.5]",
            "range = [2, -2]",
            (
                "[inputs.current] range = [2, -2]: [low, high] of two finite numbers is wanted, the"
                " lower one first"
            ),
        ),
        (
            'channel = "ao1"',
            'channel = "ao1"\nwrite = "VOLT {volts}"',
            "[inputs.current] write = 'VOLT {volts}': needs an instrument = ...",
        ),
        (
            'channel = "ao1"',
            'channel = "ao1"\nquery = "VOLT?"',
            "[inputs.current] query = 'VOLT?': needs an instrument = ...",
        ),
        ('channel = "ao1"\n', "", "[inputs.current] channel is missing: a text is wanted"),
        ("sign = -1", "sign = true", "[outputs.displacement] sign = True: 1 or -1 is wanted"),
        ("sign = -1", "sign = 2", "[outputs.displacement] sign = 2: 1 or -1 is wanted"),
        (
            'unit = "A"\nrange',
            'unit = "mm"\nrange',
            "[inputs.current] unit = 'mm': current: unit 'mm' cannot be converted",
        ),
        (
            'unit = "A"\nrange',
            'unit = "amper"\nrange',
            "[inputs.current] unit = 'amper': unknown unit 'amper'",
        ),
        ('si = "K"\n', "", "[outputs.temperature] unit = 'degC': temperature is not known by name"),
        (
            "date = 2007-05-01\n\n[outputs.dis",
            'date = "May"\n\n[outputs.dis',
            "[inputs.current] date = 'May': a date is wanted, such as 2007-05-01",
        ),
        ('channel = "ao1"', "channel = 1", "[inputs.current] channel = 1: a text is wanted"),
        (
            'channel = "ao1"',
            'instrument = "dmm"',
            "[inputs.current] instrument = 'dmm': there is no [instruments.dmm]",
        ),
        (
            'channel = "ai1"',
            'channel = "ai1"\nterminal = "rse"',
            (
                "[outputs.displacement] terminal = 'rse': Input should be 'default',"
                " 'differential', 'referenced'"
            ),
        ),
        (
            "[limits.current]",
            "[limits.curent]",
            "[limits.curent]: no such signal (did you mean current?)",
        ),
        (
            "max = 800",
            "max = 1400",
            "[limits.current] max = 1400: the range of ao1 allows -0.9 … 1.35 A only",
        ),
        (
            "max = 800",
            "max = -900",
            "[limits.current] max = -900: must be above the lower limit",
        ),
        (
            'rate = 5000\nunit = "mA"',
            'rate = 0\nunit = "mA"',
            "[limits.current] rate = 0: a finite number above 0",
        ),
        (
            "max = 800",
            "maxi = 800",
            "[limits.current] maxi = 800: there is no such key (did you mean max?)",
        ),
        ("[outputs.temperature]", "[outputs.current]", "[outputs.current]: is an input, too"),
        (
            "offset = 0.1",
            "offset = 0.1\nsafe = 0.9",
            "[inputs.current] safe = 0.9 A: is beyond its limits",
        ),
        ("[rig]", "[rig", "rig.toml: "),
        ("[rig]", "[ring]", "there is no such key (did you mean rig?)"),
        ("[rig]\nrate = 30\nwatchdog = 0.2", "", "[rig] rate is missing"),
        ("[rig]\n", "inputs = 3\n[rig]\n", "rig.toml: "),
    ],
)
def test_what_is_wrong_is_told_in_a_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in GOOD
    with pytest.raises(UserError) as caught:
        read(tmp_path, GOOD.replace(old, new, 1))
    assert message in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path / "rig.toml"))
    assert "\n" not in str(caught.value)


SENSOR = """
[rig]
rate = 30
watchdog = 0.2

[outputs.sensor]
channel = "ai0"
range = [-10, 10]
date = 2026-05-01
"""


def sensor(folder: Path, text: str) -> Channel:
    return read(folder, SENSOR + text).outputs["sensor"]


def test_sensors_have_the_units_of_the_laboratory(tmp_path: Path) -> None:
    # a load cell of 2 mV/V at 10 kgf on 5 V, amplified 500 times; 1 kgf is 9.80665 N
    bridge = 'amplification = 500\nexcitation = 5\ngain = 5\nunit = "kgf"\nsi = "N"'
    force = sensor(tmp_path, bridge)
    assert force.measured(2.5) == pytest.approx(5.0 * 9.80665)
    assert force.volts(-9.80665) == pytest.approx(-0.5)
    ratio = sensor(tmp_path, 'excitation = 10\ngain = 1\nunit = "mV/V"\nsi = "1"')
    assert ratio.measured(0.02) == pytest.approx(2e-3)
    # type K, 4.096 mV at 100 degC; a Pt100 of 138.51 ohm there
    couple = 'amplification = 100\nunit = "degC"\nsi = "K"\n'
    couple += 'conversion.thermocouple = { type = "K", cold_junction = 0.0 }'
    assert sensor(tmp_path, couple).measured(0.4096) == pytest.approx(373.15, abs=0.02)
    wire = 'current = 1e-3\nunit = "degC"\nsi = "K"\nconversion.rtd = {}'
    assert sensor(tmp_path, wire).measured(0.13851) == pytest.approx(373.15, abs=0.02)
    half = 'divider = { supply = 5.0, resistor = 10e3 }\nunit = "degC"\nsi = "K"\n'
    half += "conversion.beta = { beta = 3950.0, resistance = 10e3, span = [-20, 80] }"
    thermistor = sensor(tmp_path, half)
    assert thermistor.measured(2.5) == pytest.approx(298.15)
    assert math.isnan(thermistor.measured(4.999))  # open
    assert math.isnan(thermistor.measured(0.001))  # short
    # gain and offset adjust what a conversion gives
    adjusted = sensor(tmp_path, half + "\ngain = 1.02\noffset = -0.3")
    assert adjusted.measured(2.5) == pytest.approx(1.02 * 25.0 - 0.3 + 273.15)


def test_the_examples_of_the_reference_are_a_calibration(tmp_path: Path) -> None:
    page = (source.ROOT / "docs/reference/calibration.md").read_text(encoding="utf-8")
    examples = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    rig = read(tmp_path, SENSOR + 'gain = 1\nunit = "V"\n' + "\n".join(examples))
    outputs = rig.outputs
    assert (outputs["interlock"].measured(1.0), rig.limits["interlock"].min) == (1.0, 0.5)
    # no EMF: the junctions have one temperature; 2 mV/V on 5 V, amplified 500 times, is 5 V
    assert outputs["bath_temperature"].measured(0.0) == pytest.approx(23.0 + 273.15)
    assert outputs["load"].measured(5.0) == pytest.approx(10.0 * 9.80665)
    assert outputs["load"].si == "N"


@given(st.floats(0.0, 1.0))
def test_a_command_by_a_conversion_has_the_volts_that_give_it(share: float) -> None:
    table = [[0.0, 3.0], [1.0, 2.0], [4.0, -1.5], [10.0, -2.0]]
    with tempfile.TemporaryDirectory() as folder:
        text = GOOD.replace(
            "gain = 0.5\noffset = 0.1", f"conversion.table = {{ points = {table} }}"
        )
        text = text.replace("range = [-2, 2.5]", "range = [0, 10]")
        channel = read(Path(folder), text.split("[limits")[0]).inputs["current"]
    value = 3.0 - 5.0 * share
    x, y = np.array(table)[::-1].T
    assert channel.volts(value) == pytest.approx(np.interp(value, y, x), abs=1e-9)
    for beyond in (3.001, -2.001, math.nan):
        with pytest.raises(UserError, match="the range of ao1 allows -2 … 3 A only"):
            channel.volts(beyond)


def test_an_uncertainty_is_stated_in_si(tmp_path: Path) -> None:
    text = 'gain = 2\nunit = "kgf"\nsi = "N"\nuncertainty = 0.1\nrelative_uncertainty = 0.002'
    assert sensor(tmp_path, text).attributes == {
        "calibration_date": "2026-05-01",
        "calibration_gain": 2.0,
        "calibration_offset": 0.0,
        "standard_uncertainty": pytest.approx(0.980665),
        "relative_uncertainty": 0.002,
    }
    kelvin = 'gain = 10\nunit = "degC"\nsi = "K"\nuncertainty = 0.5'
    assert sensor(tmp_path, kelvin).attributes["standard_uncertainty"] == pytest.approx(0.5)
    assert "standard_uncertainty" not in sensor(tmp_path, 'gain = 10\nunit = "V"').attributes


CELSIUS = 'unit = "degC"\nsi = "K"\n'
RTD = CELSIUS + "conversion.rtd = {}\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            RTD,
            "range = [-10, 10]: no volts in it have a value, by this conversion",
        ),
        (
            RTD + "excitation = 5",
            "excitation = 5: is no circuit for the conversion",
        ),
        (RTD + "current = 0", "current = 0: a finite number above 0 is wanted"),
        (
            RTD + "current = 1e-3\ndivider = { supply = 5, resistor = 1e3 }",
            "is one circuit, and current",
        ),
        (RTD.replace("degC", "K"), "unit = 'K': the conversion gives degC"),
        (RTD.replace("rtd", "rdt"), "conversion.rdt = {}: there is no such conversion (did you"),
        (RTD.replace("{}", "{ r0 = -1 }"), "conversion.rtd.r0 = -1: a finite number above 0"),
        (
            RTD + "current = 1.0",
            "range = [-10, 10]: no volts in it have a value",
        ),
        (
            RTD + "current = 1e-3\nrelative_uncertainty = 0.01",
            "relative_uncertainty = 0.01: is no part of a value in degC, which has an arbitrary",
        ),
        (RTD + "uncertainty = -1", "uncertainty = -1: a number of at least 0 is wanted"),
        (
            RTD + "divider = { supply = 5.0 }",
            "divider.resistor is missing: a finite number above 0",
        ),
        (
            'gain = 1\nunit = "V"\nconversion.table = { points = [[0, 1], [1, 2], [2, 2]] }',
            "conversion.table.points = [[0, 1], [1, 2], [2, 2]]: [[signal, value], ...]",
        ),
        (
            'unit = "V"\nconversion.polynomial = { coefficients = [1.0] }',
            "conversion.polynomial.coefficients = [1.0]: a list of 2 to 16 finite numbers",
        ),
        (
            CELSIUS + 'conversion.thermocouple = { type = "L", cold_junction = 20 }',
            "conversion.thermocouple.type = 'L': Input should be 'B', 'E', 'J', 'K', 'N', 'R', 'S'",
        ),
        (
            CELSIUS + 'conversion.thermocouple = { type = "K" }',
            "conversion.thermocouple.cold_junction is missing: a temperature of 0 to 100 degC",
        ),
    ],
)
def test_a_wrong_conversion_is_told_in_a_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(UserError) as caught:
        sensor(tmp_path, text)
    assert message in str(caught.value)
    assert str(caught.value).startswith(f"{tmp_path / 'rig.toml'}: [outputs.sensor] ")
    assert "\n" not in str(caught.value)


def test_a_command_is_not_by_a_conversion_that_turns(tmp_path: Path) -> None:
    # a parabola with its top at 1 V
    parabola = "conversion.polynomial = { coefficients = [0.0, 2.0, -1.0] }"
    text = GOOD.replace("gain = 0.5\noffset = 0.1", parabola).split("[limits")[0]
    with pytest.raises(UserError, match=r"\[inputs.current\] range = .*rises or falls over all"):
        read(tmp_path, text)
    branch = text.replace("range = [-2, 2.5]", "range = [-2, 1]")
    assert read(tmp_path, branch).inputs["current"].volts(0.75) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("message", "wrong"),
    [
        ('write = "VOLT {volts:.3f}"', ""),
        ('write = "VOLT 3"', "[inputs.current] write = 'VOLT 3': a message is wanted with {volts}"),
        (
            'write = "VOLT {ampere}"',
            "[inputs.current] write = 'VOLT {ampere}': a message is wanted with {volts}",
        ),
        ('write = "VOLT {volts:y}"', "a message is wanted with {volts}"),
        ("", "[inputs.current] write is missing: a text is wanted"),
    ],
)
def test_messages_of_instruments_have_a_place_for_the_number(
    tmp_path: Path, message: str, wrong: str
) -> None:
    text = GOOD.replace('channel = "ao1"', f'instrument = "generator"\n{message}')
    text += '\n[instruments.generator]\nresource = "GPIB0::1::INSTR"\n'
    if not wrong:
        assert read(tmp_path, text).inputs["current"].message == "VOLT {volts:.3f}"
        return
    with pytest.raises(UserError) as caught:
        read(tmp_path, text)
    assert wrong in str(caught.value)


def test_a_signal_has_one_place(tmp_path: Path) -> None:
    text = GOOD.replace('channel = "ao1"', 'channel = "ao1"\ninstrument = "dmm"')
    text += '\n[instruments.dmm]\nresource = "GPIB0::1::INSTR"\n'
    with pytest.raises(UserError, match=r"\[inputs.current\] channel = 'ao1': a signal is either"):
        read(tmp_path, text)


def test_a_timeout_that_would_hold_up_the_rig_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"\[instruments.dmm\] timeout = 60: .*at most 5 s"):
        read(tmp_path, GOOD + '\n[instruments.dmm]\nresource = "GPIB0::1::INSTR"\ntimeout = 60\n')


def test_a_file_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(
        UserError, match=r"thesi: no such calibration file or preset \(did you mean thesis\?\)"
    ):
        read_calibration("thesi")
    for name, told in (("", "."), ("x" * 300, "x" * 300)):
        with pytest.raises(UserError, match=f"^{re.escape(told)}: no such calibration file"):
            read_calibration(name)
    (tmp_path / "rig.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(UserError, match="not a text in UTF-8"):
        read_calibration(str(tmp_path / "rig.toml"))


@pytest.mark.parametrize("name", presets())
def test_presets_say_where_every_factor_is_from(name: str) -> None:
    rig = read_calibration(name)
    channels = (*rig.inputs.values(), *rig.outputs.values())
    assert all("section" in c.source or "assumed" in c.source for c in channels)
    assert (rig.limits["current"].min, rig.limits["current"].max) == (-1.3, 1.3)  # table 2-2


def test_the_presets_sensors_resolve_what_the_thesis_says() -> None:
    # one count of a converter of 16 bits over ±10 V: below 0.001 N and 0.003 mm (section 2.2.2)
    count, rig = 20.0 / 2**16, read_calibration("thesis")
    assert count * rig.outputs["force_measured"].gain < 0.001
    assert count * rig.outputs["displacement"].gain < 0.003  # mm
    assert rig.rate == 30.0
    assert rig.outputs["force_measured"].measured(4.0) == pytest.approx(
        44.5 * 4.0 / (20e-3 * 1000)
    )  # 20 mV, 1000 times
    assert rig.outputs["displacement"].measured(5.0) == pytest.approx(25.4e-3)  # half of the stroke
    assert all(math.isnan(channel.measured(10.0)) for channel in rig.outputs.values())


@pytest.mark.parametrize("preset", sorted(presets()))
def test_a_shipped_proxy_fits_to_every_shipped_calibration(preset: str) -> None:
    """It commands all inputs of the rig, and asks for nothing that is not measured."""
    inputs, outputs = read_calibration(preset).units
    fitting = []
    for name in PROXIES:
        layout = component(name).layout
        measured = {v.name: v.unit for v in layout.outputs if f"{v.name}_age" in layout.names}
        if {
            v.name: v.unit for v in layout.inputs
        } == inputs and measured.items() <= outputs.items():
            fitting.append(name)
    assert f"rig_proxy_{preset}" in fitting
