"""Claims: ``ppy simulate`` runs a model over a record or constant inputs."""

import numpy as np
import pytest

from orchestration.records import read_record
from tests.support.command import PNG, UNITS, refused, works
from tests.support.fmi3_fmus import foreign


@pytest.mark.slow
def test_simulate_a_recorded_stimulus(record, tmp_path):
    """Inputs from a file, a renamed column, units, a preset; result and picture."""
    text = record.read_text(encoding="utf-8").replace("current [A]", "drive [A]", 1)
    record.write_text(text, encoding="utf-8")
    printed = works(
        "simulate",
        "ppy_actuator",
        "--input",
        record,
        "--map",
        "drive=current",
        "--preset",
        "five_layer",
        "--set",
        "R1=800mohm",
        "--set",
        "k1=6.3[N/mm]",
        "--out",
        "run.csv",
        "--plot",
        "run.png",
        cwd=tmp_path,
    )
    assert "600 points from 0 s to 59.9 s" in printed
    units = {**UNITS, "charge": "C", "mechanical_displacement": "m"}
    run, inputs = (
        read_record(tmp_path / "run.csv", units),
        read_record(record, UNITS, mapping={"drive": "current"}),
    )
    assert run.time.tobytes() == inputs.time.tobytes()
    assert run.signals["current"].tobytes() == inputs.signals["current"].tobytes()
    # the preset's C and R2 with R1 as set, checked where nothing is differentiated: V (R1 + R2) =
    # R1 R2 i + R2 Q / C
    u, q, i = (run.signals[n] for n in ("voltage", "charge", "current"))
    assert u * (0.8 + 2.72) == pytest.approx(0.8 * 2.72 * i + 2.72 * q / 0.46, abs=1e-9)
    assert run.signals["mechanical_displacement"][0] == pytest.approx(
        run.signals["force"][0] / 6300.0
    )
    assert (tmp_path / "run.png").read_bytes().startswith(PNG)


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["svg", "pdf"])
def test_pictures_in_other_formats(ending, tmp_path):
    works(
        "simulate",
        "ppy_actuator",
        "--set",
        "force=1",
        "--stop",
        5,
        "--plot",
        f"run.{ending}",
        cwd=tmp_path,
    )
    assert (tmp_path / f"run.{ending}").read_bytes().lstrip()[:5] in (b"<?xml", b"%PDF-")


def test_simulate_with_its_own_steps(tmp_path):
    """Hold inputs from the start on; the last step is shorter, and both builds print the same."""
    arguments = [
        "simulate",
        "ppy_actuator",
        "--set",
        "current=0.9A",
        "--set",
        "force=2",
        "--stop",
        5,
        "--step",
        0.3,
    ]
    native = works(*arguments, "--out", "native.csv", cwd=tmp_path)
    assert "18 points from 0 s to 5 s" in native
    assert works(
        *arguments, "--runtime", "python", "--out", "python.csv", cwd=tmp_path
    ) == native.replace("native.csv", "python.csv")
    run = read_record(tmp_path / "native.csv", {**UNITS, "charge": "C"})
    assert run.time[-2:] == pytest.approx([4.8, 5.0])
    settled = 2.35 * 2.7 * 0.9
    assert run.signals["charge"] == pytest.approx(
        settled * (1 - np.exp(-run.time / (2.78 * 2.7))), abs=1e-7
    )


def test_simulate_a_part_of_a_record(record, tmp_path):
    assert "101 points from 0 s to 10 s" in works(
        "simulate", "ppy_actuator", "--input", record, "--stop", 10, cwd=tmp_path
    )
    assert "121 points from 0 s to 120 s" in works(
        "simulate", "ppy_actuator", "--input", record, "--stop", 120, "--step", 1, cwd=tmp_path
    )


def test_a_system_is_simulated_by_its_name(tmp_path):
    """A component of the same name goes first."""
    arguments = ["--set", "force_reference=1N", "--stop", "0.1s"]
    assert "bench.force_measured" in works("simulate", "dma_bench", *arguments, cwd=tmp_path)
    assert "stand." not in works("simulate", "isotonic_stand", "--stop", "1s", cwd=tmp_path)


def test_a_simulation_that_its_fmu_ends_is_no_failure(tmp_path):
    arguments = [foreign("sawtooth"), "--set", "manner=3", "--step", "0.1s", "--out", "run.csv"]
    told = works("simulate", *arguments, cwd=tmp_path)
    assert "4 points from 0 s to 0.3 s" in told
    rows = (tmp_path / "run.csv").read_text().splitlines()
    assert [float(row.split(",")[2]) for row in rows[1:]] == [0.0, 0.0, 0.0, 1.0]


@pytest.mark.parametrize("kind", ["component", "file"])
def test_a_tunable_parameter_moves_at_a_limited_rate(kind, fmu, tmp_path):
    """The force follows the limit, which is a ramp from its start value of 3 N."""
    model = "ppy_actuator" if kind == "component" else fmu("ppy_actuator", "native")
    works(
        *("simulate", model, "--set", "force=0.5N", "--set", "force_limit=1N@0.5s@2N/s"),
        *("--stop", "2", "--step", "0.05", "--out", "out.csv"),
        cwd=tmp_path,
    )
    found = read_record(tmp_path / "out.csv", {"force_limit": "N", "force_margin": "N"})
    limit = 3.0 - np.clip(2.0 * (found.time - 0.5), 0.0, 2.0)
    np.testing.assert_allclose(found.signals["force_limit"], limit, atol=1e-12)
    np.testing.assert_allclose(found.signals["force_margin"], limit - 0.5, atol=1e-9)


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("R1=1@1s", "R1 is not tunable: it has one value in a run"),
        ("force_limit=-1@1s", "--set force_limit: -1 N is out of range; allowed is"),
        ("force_limit=1@soon", "inputs.force_limit.times[0] = 'soon': a finite number"),
        ("force_limit=1@1s@0", "slew = 0.0 per second: must be above 0"),
        ("force_limit=1@1s@3V", "slew = 3 V"),
    ],
)
def test_a_move_that_cannot_be_is_refused_in_a_line(setting, words, tmp_path):
    assert words in refused(tmp_path, "simulate", "ppy_actuator", "--set", setting)
