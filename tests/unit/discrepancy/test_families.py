"""Claims: an effect that a model's own file does not list is considered by its units.

The records are written here by closed form.
"""

from __future__ import annotations

import numpy as np
import pytest

import orchestration as ppy
from fmus.kit.build.toolchain import host_platform
from fmus.kit.errors import UserError
from orchestration.discrepancy.candidates.scales import signal_scales
from orchestration.fmu.effects import find_effects
from orchestration.fmu.model import load_class
from orchestration.records.writing import write_record

MODEL = '''
from fmus.kit import Component, Input, Output, Parameter, State


class Drive(Component):
    """First order."""

    name = "drive"
    gain = Parameter(3.0, "rad/s/V", min=1e-6, max=1e6, doc="speed per volt")
    lag = Parameter(0.3, "s", min=1e-3, max=1e3, doc="time constant")
    voltage = Input("V", doc="what is commanded")
    omega = State("rad/s", rate="omega_rate", doc="speed")

    def drag(self):
        """Speed that is lost."""
        return self.omega

    def omega_rate(self):
        """First order."""
        return (self.gain * self.voltage - self.drag()) / self.lag

    @Output("rad/s")
    def speed(self):
        """As measured."""
        return self.omega
'''
GAIN, LAG, DEAD, STEP = 4.0, 0.25, 1.2, 0.02


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Write a model without effects, and a record of a drive that has a dead zone."""
    folder = tmp_path_factory.mktemp("drive")
    (folder / "drive.py").write_text(MODEL, encoding="utf-8")
    rng = np.random.default_rng(7)
    voltage = np.repeat(rng.uniform(-5.0, 5.0, 100), 20)
    arrives = np.sign(voltage) * np.maximum(np.abs(voltage) - DEAD, 0.0)
    speed, keeps = [0.0], np.exp(-STEP / LAG)
    for u in arrives[:-1]:  # exact for an input that is held
        speed.append(keeps * speed[-1] + (1.0 - keeps) * GAIN * u)
    time = STEP * np.arange(voltage.size)
    measured = np.array(speed) + 0.05 * rng.standard_normal(voltage.size)
    write_record(
        folder / "drive.csv",
        time,
        {"voltage": voltage, "speed": measured},
        {"voltage": "V", "speed": "rad/s"},
    )
    return folder


def test_a_dead_zone_is_named_that_no_file_lists(folder):
    model = f"{folder / 'drive.py'}:Drive"
    said = ppy.diagnose(folder / "drive.csv", model)
    assert (said.verdict, said.causes) == ("cause", ["dead_zone(voltage)"])
    for name, true in (("gain", GAIN), ("lag", LAG), ("voltage_dead_zone", DEAD)):
        low, high = said.parameters[name].interval
        margin = 0.5 * (high - low)
        assert low - margin <= true <= high + margin, name
    native, _ = said.fmu(folder / "better.fmu", [host_platform()])
    assert native.exists()


@pytest.mark.slow
def test_they_have_to_be_asked_for_where_a_file_lists_its_own(folder):
    listing = "from fmus.kit.generic import force_offset\n" + MODEL
    listing += '\n\nEFFECTS = {"force_offset": force_offset(Drive, "drag", unit="rad/s")}\n'
    (folder / "listing.py").write_text(listing, encoding="utf-8")
    model = f"{folder / 'listing.py'}:Drive"
    assert ppy.diagnose(folder / "drive.csv", model).causes != ["dead_zone(voltage)"]
    assert ppy.diagnose(folder / "drive.csv", model, effects=["families"]).causes == [
        "dead_zone(voltage)"
    ]


def test_one_of_them_can_be_asked_for_by_name(folder):
    model = f"{folder / 'drive.py'}:Drive"
    said = ppy.diagnose(folder / "drive.csv", model, effects=["dead_zone(voltage)"])
    assert said.causes == ["dead_zone(voltage)"]
    with pytest.raises(UserError, match=r"no effect named 'dead_zone\(speed\)'"):
        ppy.diagnose(folder / "drive.csv", model, effects=["dead_zone(speed)"])
    cls = load_class(model)
    (effect,) = find_effects(cls, ["backlash(voltage)"], "drive")
    assert effect.id == "backlash"


def test_magnitudes_are_those_of_the_record_to_one_figure(folder):
    cls = load_class(f"{folder / 'drive.py'}:Drive")
    time = 0.01 * np.arange(4000)
    found = signal_scales(cls, time, {"voltage": np.full(4000, 2.4)}, {"gain": 30.0})
    # it comes to 72 rad/s; its rate is 240 rad/s^2 exp(-t / 0.3 s), which after 5 % of the 40 s is
    # 0.3
    assert found == {"voltage": 2.0, "omega": 50.0, "drag": 50.0, "speed": 50.0, "omega_rate": 0.2}
