"""Claims: of a specimen on the emulated rig, which shares no code with the model, the parameters
are found within their intervals at the stated rate; what no record tells is said, with the test
that would; every command takes the file of parameters.
"""

from __future__ import annotations

import json
import math
import re
import tomllib
from dataclasses import asdict
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from demonstrations.characterise import Characterisation, characterise
from demonstrations.emulator import RigParameters
from examples.specimen import write_tests
from orchestration.fmu.model import built, declared_model
from orchestration.identify import read_for
from orchestration.identify.uncertainty import Estimate
from tests.support.command import here

SPECIMENS = 12


def characterised(folder: Path, *names: str) -> Characterisation:
    model = declared_model("ppy_actuator")
    files = [folder / f"{name}.csv" for name in names] or sorted(folder.glob("*.csv"))
    return characterise(built(model), [read_for(model, file) for file in files])


@pytest.mark.parametrize(("half", "is_known"), [(0.49, True), (0.51, False), (math.inf, False)])
def test_a_value_that_may_be_half_as_large_is_not_determined(half, is_known):
    estimate = Estimate(2.0, 1.0, (2.0 - 2.0 * half, 2.0 + 2.0 * half), "ohm")
    joint = SimpleNamespace(fit=SimpleNamespace(estimates={"R1": estimate}))
    found = Characterisation(None, {"record": None}, {}, joint, ())
    assert ("R1" in found.determined, "R1" in found.missing) == (is_known, not is_known)


@pytest.mark.slow
def test_true_values_are_in_their_intervals_at_the_stated_rate(tmp_path):
    """96 intervals of 95 %: at most 11 misses with 99 % (binomial)."""
    misses = []
    for seed in range(SPECIMENS):
        folder = tmp_path / str(seed)
        true = asdict(write_tests(folder, seed))
        found = characterised(folder)
        assert not found.missing
        assert not found.remarks
        for name, (low, high) in found.fit.intervals.items():
            if not low <= true[name] <= high:
                misses.append((seed, name))
            # an interval that holds everything says nothing
            assert (high - low) / true[name] < 0.1, (seed, name)
    print(f"{8 * SPECIMENS - len(misses)} of {8 * SPECIMENS} within 95 % intervals: {misses}")
    assert len(misses) <= 11


@pytest.mark.slow
def test_a_held_voltage_that_is_sampled_seldom_tells_the_circuit(tmp_path):
    """Of 20 intervals of 95 % at most 4 miss with 99.7 %; by a current that is held between samples
    C would be 6 % off. Closed form of the current.
    """
    R1, R2, C, volts = 0.71, 3.4, 1.9, 0.5
    time = np.arange(0.0, 65.0, 0.2)
    held = time >= 5.0
    falls = np.exp(-(time - 5.0).clip(0.0) / (R1 * C))
    current = np.where(held, volts / R2 + volts / R1 * falls, 0.0)
    misses = 0
    for seed in range(10):
        rng = np.random.default_rng(seed)
        voltage = volts * held + 1e-3 * rng.standard_normal(time.size)
        table = np.column_stack([time, current, voltage])
        file = tmp_path / f"{seed}.csv"
        np.savetxt(file, table, "%.9g", ",", header="time [s],current [A],voltage [V]", comments="")
        intervals = characterised(tmp_path, str(seed)).fit.intervals
        for name, true in (("R2", R2), ("C", C)):
            low, high = intervals[name]
            misses += not low <= true <= high
            assert (high - low) / true < 0.02, name
    assert misses <= 4


@pytest.mark.slow
@pytest.mark.parametrize("is_held", [False, True])
def test_a_prbs_tells_whether_the_current_of_a_held_voltage_is_held(tmp_path, is_held):
    """Closed form of R2 beside R1 and C in series, of ten drawn specimens: read the other way, C
    would be 1 % off and more. Of 30 intervals of 95 % at most 5 miss with 99.7 %.
    """
    misses = 0
    for seed in range(10):
        rng = np.random.default_rng([seed, is_held])
        R1, R2, C = rng.uniform((0.4, 2.0, 1.0), (0.9, 5.0, 3.0))
        volts, step = rng.uniform(0.3, 0.6), rng.choice([0.1, 0.2])

        def voltages(current, step, R1=R1, R2=R2, C=C):
            """Voltages with a current that is held between samples; the capacitor is empty."""
            kept = np.exp(-step / ((R1 + R2) * C))
            inner = lfilter([0.0, 1.0 - kept], [1.0, -kept], R2 * current)
            return (R1 * R2 * current + R2 * inner) / (R1 + R2)

        time = np.arange(0.0, 60.0, step)
        since = time - 4.0
        rate = 1.0 / (R1 * C)
        if is_held:  # by the current that keeps the voltage at each sample
            kept = 1.0 - (1.0 - np.exp(-step / ((R1 + R2) * C))) * (R1 + R2) / R1
            falls = kept ** np.rint(since.clip(0.0) / step)
        else:
            falls = np.exp(-since.clip(0.0) * rate)
        current = np.where(since >= -1e-9, volts / R2 + volts / R1 * falls, 0.0)
        bits = np.repeat(rng.choice([-0.6, 0.6], 80), 10)
        for name, t, i, v in (
            ("held", time, current, np.where(since >= -1e-9, volts, 0.0)),
            ("prbs", 0.05 * np.arange(bits.size), bits, voltages(bits, 0.05)),
        ):
            table = np.column_stack([t, i, v + 1e-3 * rng.standard_normal(t.size)])
            head = "time [s],current [A],voltage [V]"
            file = tmp_path / f"{seed}-{name}.csv"
            np.savetxt(file, table, "%.9g", ",", header=head, comments="")
        found = characterised(tmp_path, f"{seed}-held", f"{seed}-prbs")
        assert not found.remarks
        assert found.fit.values["C"] == pytest.approx(C, rel=3e-3)
        for name, true in (("R1", R1), ("R2", R2), ("C", C)):
            low, high = found.fit.intervals[name]
            misses += not low <= true <= high
    assert misses <= 5


@pytest.mark.slow
def test_what_is_not_determined_is_said_with_the_test_that_would_tell(tmp_path):
    write_tests(tmp_path)
    found = characterised(tmp_path, "held_voltage")
    assert set(found.determined) == {"R1", "R2", "C"}
    assert set(found.missing) == {"alpha", "k1", "b1", "k2", "b2"}
    assert found.missing["alpha"].startswith("triangle of charge: a square wave")
    assert "PRBS: a pseudorandom" in found.missing["alpha"]
    assert found.missing["b2"].startswith("held force with creep: no current")


@pytest.mark.slow
def test_the_command_leaves_files_that_other_commands_take(tmp_path):
    true = asdict(write_tests(tmp_path / "raw", seed=2))
    done = here("characterise", "raw", "--out", "film_2", "--json", "film.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "held force with creep" in done.stdout
    folder = tmp_path / "film_2"
    values = tomllib.loads((folder / "specimen.toml").read_text())["parameters"]
    for name, text in values.items():
        assert float(text.split()[0]) == pytest.approx(true[name], rel=0.05), name
    figures = json.loads((tmp_path / "film.json").read_text())
    assert figures["tests"]["prbs"] == "PRBS"
    readme = (folder / "README.md").read_text()
    assert readme.startswith("# film_2\n")
    assert re.search(r"^C +prbs ", readme, re.M)
    assert "triangle of charge" in (folder / "specimen.html").read_text()
    words = ("--params", folder / "specimen.toml", "--json", "-")
    said = json.loads(here("compare", "raw/prbs.csv", *words, cwd=tmp_path).stdout)
    assert said["outputs"]["voltage"]["fit_percent"] > 95
    assert said["set"]["R1"] == pytest.approx(true["R1"], rel=0.01)


def test_a_specimen_that_has_aged_differs_by_its_factors(tmp_path):
    first = RigParameters.scattered(4)
    aged = write_tests(tmp_path, 4, {"C": 0.9})
    assert pytest.approx(0.9 * first.C) == aged.C
    assert aged.R1 == first.R1


def test_a_folder_without_records_is_refused(tmp_path):
    (tmp_path / "raw").mkdir()
    done = here("characterise", "raw", cwd=tmp_path)
    assert done.returncode == 2
    assert "raw" in done.stderr
