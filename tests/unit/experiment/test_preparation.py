"""Claims: what does not fit the subject of an experiment is one line that says where and what is
allowed, and earlier results stay.
"""

import pytest

from tests.support.command import refused
from tests.support.experiments import GOOD, good_experiment


@pytest.fixture
def folder(tmp_path):
    return good_experiment(tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ("[inputs]", "[inputs", ["line 6", "column"]),
        ("[inputs]", "[inputs]\nforce = 2", ["overwrite", "line"]),
        ("ppy_actuator", "ppy_actuater", ["'ppy_actuater'", "did you mean ppy_actuator?"]),
        ("ppy_actuator", "other.fmu", ["other.fmu", "no such file"]),
        (
            'component = "ppy_actuator"',
            'system = "dma_bensh"',
            ["'dma_bensh'", "did you mean dma_bench?"],
        ),
        ('component = "ppy_actuator"', 'system = "other.ssp"', ["other.ssp"]),
        (
            "component =",
            'preset = "six_layer"\ncomponent =',
            ["no preset named 'six_layer'", "five_layer"],
        ),
        (
            "component =",
            'effects = ["quadratic_strian"]\ncomponent =',
            ["'quadratic_strian'", "quadratic_strain?"],
        ),
        ('"2 s"', "1e9", ["at most 1e7"]),
        ('["voltage"]', '["voltagge"]', ["record", "'voltagge'", "did you mean voltage?"]),
        ('["voltage"]', '["R1"]', ["record", "'R1'"]),
        ('"1 N"', '"1 mm"', ["inputs.force", "value = 1 mm", "'mm'", "'N'"]),
        ("force =", "forse =", ["no input named 'forse'", "did you mean force?"]),
        ('"0.9 A"', '"0.9 V"', ["inputs.current", "amplitude = 0.9 V", "'A'"]),
        (
            "[inputs]",
            "[parameters]\nR9 = 1\n[inputs]",
            ["no parameter named 'R9'", "did you mean R"],
        ),
        (
            "[inputs]",
            "[parameters]\nR1 = -1\n[inputs]",
            ["parameters.R1 = -1", "out of range", "0 … 1e+06 ohm"],
        ),
        ("[inputs]", "[parameters]\nR1 = '1 V'\n[inputs]", ["parameters.R1 = 1 V", "'V'", "'ohm'"]),
        (
            "[inputs]",
            "[parameters]\nR1 = nan\n[inputs]",
            ["parameters.R1 = nan", "'nan' is not a number"],
        ),
        (
            "[inputs]",
            "[parameters]\ncurrent = 1\n[inputs]",
            ["parameters.current", "inputs.current"],
        ),
        (
            "[inputs]",
            "[noise.displacement]\nrms = 1e-6\n[inputs]",
            ["noise.displacement", "recorded outputs"],
        ),
        ("[inputs]", "[noise.voltage]\nrms = '1 A'\n[inputs]", ["noise.voltage.rms = 1 A", "'V'"]),
        (
            "[inputs]",
            "[noise.voltage]\nrms = -1\n[inputs]",
            ["noise.voltage.rms = -1", "0 or more"],
        ),
        ("component =", 'over = "charge"\ncomponent =', ["over", "'charge'"]),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_experiments_that_cannot_be_made(folder, old, new, parts):
    assert old in GOOD
    (folder / "bad.toml").write_text(GOOD.replace(old, new, 1), encoding="utf-8")
    line = refused(folder, "run", "bad.toml", "--out", "out.nc", "--plot", "out.png", parts=parts)
    assert line.startswith("error: bad.toml: ")
