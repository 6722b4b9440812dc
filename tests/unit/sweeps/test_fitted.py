"""Draws of a fit, read from its file, and their bands.

Oracle: a law that is linear in its parameters, in closed form.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray
from scipy.stats import norm

import orchestration as ppy
from fmus.kit import UserError
from orchestration.fmu.model import model_of
from orchestration.identify import comparison
from orchestration.identify.fitting import FitData
from orchestration.identify.uncertainty.estimate import Estimate, joint_distribution
from orchestration.records import write_record
from orchestration.sweeps.fitted import read_fitted
from tests.support.command import PNG, here, refused, works
from tests.support.hosts import build_one_state_fmu
from tests.support.line import HALF, TIME, Line, estimates


def test_draws_have_the_covariance_that_is_given():
    """A covariance of n draws has standard error ``sqrt((s_ii s_jj + s_ij^2) / n)`` (Wishart)."""
    errors, count = np.array([0.3, 0.02, 5.0]), 40_000
    correlations = {("a", "B"): 0.8, ("a", "c"): -0.5, ("B", "c"): 0.1}
    given = joint_distribution(
        estimates(a=(1.0, 0.3), B=(7.0, 0.02), c=(-40.0, 5.0)), correlations, ["B"]
    )
    matrix = np.array([[1.0, 0.8, -0.5], [0.8, 1.0, 0.1], [-0.5, 0.1, 1.0]]) * np.outer(
        errors, errors
    )
    drawn = given.draws(count, seed=3)
    searched = np.array([drawn["a"], np.log(drawn["B"]), drawn["c"]])
    spread = np.sqrt((np.outer(np.diag(matrix), np.diag(matrix)) + matrix**2) / count)
    assert (np.abs(np.cov(searched) - matrix) < 4.0 * spread).all()
    assert (
        np.abs(searched.mean(axis=1) - [1.0, np.log(7.0), -40.0]) < 4.0 * errors / np.sqrt(count)
    ).all()


def test_draws_of_parameters_that_are_known_together_only():
    """With a correlation of one the covariance is singular."""
    given = joint_distribution(estimates(a=(1.0, 0.5), b=(2.0, 1.0)), {("a", "b"): 1.0}, [])
    drawn = given.draws(50)
    assert drawn["b"] - 2.0 == pytest.approx(2.0 * (drawn["a"] - 1.0), abs=1e-12)
    assert np.std(drawn["a"]) > 0.3


def test_the_same_seed_comes_to_the_same_draws():
    given = joint_distribution(estimates(a=(1.0, 0.3), B=(7.0, 0.02)), {("a", "B"): 0.8}, ["B"])
    one, again, other = (given.draws(10, seed) for seed in (1, 1, 2))
    for name in ("a", "B"):
        assert one[name].tolist() == again[name].tolist()
        assert one[name].tolist() != other[name].tolist()


def test_what_cannot_be_drawn_is_told_in_a_line():
    open_ended = {**estimates(a=(1.0, 0.3)), "b": Estimate(1.0, 1.0, (0.0, np.inf), "1")}
    with pytest.raises(UserError, match="does not determine b: fit without"):
        joint_distribution(open_ended, {("a", "b"): 0.0}, ["b"])
    given = joint_distribution(estimates(a=(1.0, 0.3)), {}, [])
    assert len(given.draws(np.int64(3), np.uint8(1))["a"]) == 3
    for count, seed in ((0, 0), (3, -1), (-3, 0), (1.5, 0), (np.nan, 0), (3, 0.5), ("3", 0)):
        with pytest.raises(UserError, match=f"{count} draws with seed {seed}"):
            given.draws(count, seed)


@pytest.mark.parametrize(
    ("opposed", "allowed"), [(-0.9, False), (-0.5001, False), (-0.5, True), (-0.50000001, True)]
)
def test_correlations_that_contradict_each_other_are_refused(opposed, allowed):
    """If all three oppose each other alike, the matrix has the eigenvalue ``1 + 2 r``."""
    of = estimates(a=(1.0, 0.3), b=(2e-9, 1e-10), c=(5e6, 1e5))
    given = joint_distribution(of, dict.fromkeys([("a", "b"), ("a", "c"), ("b", "c")], opposed), [])
    if allowed:
        assert np.isfinite(given.draws(5)["b"]).all()
    else:
        with pytest.raises(
            UserError,
            match=f"correlations of a, b, c contradict each other.*{1.0 + 2.0 * opposed:.3g}",
        ):
            given.draws(5)


def test_draws_of_a_fit_have_the_covariance_of_least_squares():
    """The covariance is ``s^2 (X'X)^-1``, that of the gain in its logarithm divided by the gain.

    A fit allows for colour of the noise, which it estimates; over twenty records that scatters
    about none.
    """
    time, u, true = 0.1 * np.arange(401), np.linspace(-1.0, 3.0, 401), np.array([1.3, 1.8])
    regressors = np.column_stack([np.ones_like(u), u])
    exact = 0.1**2 * np.linalg.inv(regressors.T @ regressors)
    found = []
    for seed in range(20):
        y = regressors @ true + np.random.default_rng(seed).normal(0.0, 0.1, 401)
        fit = comparison.fit_model(
            model_of(Line), [FitData(time, {"u": u}, {"y": y})], ["offset", "gain"], {}
        )
        assert fit.logarithmic == ("gain",)
        drawn = fit.draws(10_000, seed)
        found.append(np.cov(drawn["offset"], true[1] * np.log(drawn["gain"])))
    assert np.mean(found, axis=0) == pytest.approx(exact, rel=0.1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with a fit of ``tau`` of an FMU by its record."""
    folder = tmp_path_factory.mktemp("bands")
    build_one_state_fmu(folder)
    x = 1.0 - np.exp(-TIME / 0.73) + np.random.default_rng(1).normal(0.0, 0.02, 101)
    write_record(folder / "r.csv", TIME, {"u": np.ones(101), "x": x}, {"u": "1", "x": "1"})
    works(
        "identify",
        "r.csv",
        "--model",
        "one_state.fmu",
        "--fit",
        "tau",
        "--json",
        "fit.json",
        cwd=folder,
    )
    return folder


CALL = (
    "sweep",
    "one_state.fmu",
    "--fitted",
    "fit.json",
    "--set",
    "u=2",
    "--stop",
    "2s",
    "--step",
    "0.1s",
)


@pytest.mark.slow
def test_bands_are_printed_written_and_drawn(folder):
    """``x(t) = u (1 - exp(-t / tau))`` falls with tau: its quantiles are those of tau, reversed."""
    said = works(*CALL, "--samples", 500, "--out", "b.nc", "--plot", "b.png", cwd=folder)
    assert (folder / "b.png").read_bytes().startswith(PNG)
    read = xarray.load_dataset(folder / "b.nc", engine="scipy")
    exact = [
        2.0 * (1.0 - np.exp(-2.0 / t)) for t in np.quantile(read["tau"].values, [0.95, 0.5, 0.05])
    ]
    assert read["x_band"].sel(time=2.0).values == pytest.approx(exact, rel=1e-4)
    end = next(
        line.split() for line in said.splitlines() if line.startswith("x ") and " 2 s " in line
    )
    assert [float(word) for word in end[3:6]] == pytest.approx(
        read["x_band"].isel(time=-1).values.tolist(), rel=1e-5
    )
    fit = ppy.fit(folder / "r.csv", str(folder / "one_state.fmu"), ["tau"])
    assert read["tau"].values == pytest.approx(fit.draws(500, seed=0)["tau"], rel=1e-12)


@pytest.mark.slow
def test_the_seed_chooses_the_draws(folder):
    values = []
    for k, seed in enumerate((5, 5, 6)):
        assert (
            here(*CALL, "--samples", 20, "--seed", seed, "--out", f"{k}.nc", cwd=folder).returncode
            == 0
        )
        values.append(
            xarray.load_dataset(folder / f"{k}.nc", engine="scipy")["tau"].values.tolist()
        )
    assert values[0] == values[1] != values[2]


@pytest.mark.slow
def test_a_file_may_name_a_fit(folder):
    text = (
        'fitted = "fit.json"\nsamples = 20\nseed = 3\n[experiment]\ncomponent ='
        ' "one_state.fmu"\nduration = "2 s"\nstep = "100 ms"\nparameters.tau = 9\ninputs.u = { kind'
        ' = "constant", value = 2 }\n'
    )
    (folder / "s.toml").write_text(text)
    found = ppy.sweep_file(folder / "s.toml")
    assert found["x"].dims == ("case", "time")
    assert found["tau"].values == pytest.approx(
        read_fitted(folder / "fit.json", ppy.find_model(str(folder / "one_state.fmu"))).draws(
            20, 3
        )["tau"]
    )
    assert "quantiles of" in here("sweep", "s.toml", cwd=folder).stdout
    for old, new, told in (
        ("samples = 20\n", "", "such as samples = 200"),
        (
            "samples = 20\n",
            'samples = 20\ndesign = "sobol"\n',
            "both a fit to draw parameters from and a design",
        ),
        ("samples = 20\n", 'samples = 20\nover.tau = "1..2:3"\n', "or a fit to draw them from"),
    ):
        (folder / "t.toml").write_text(text.replace(old, new))
        with pytest.raises(UserError, match=told):
            ppy.sweep_file(folder / "t.toml")


def test_what_was_set_otherwise_in_the_fit_is_noted(tmp_path):
    """A fit holds for the settings that it was made with."""
    answer = {"fitted": {"parameters": {}, "correlations": []}, "set": {"gain": 3.0}}
    answer["fitted"]["parameters"]["offset"] = {
        "value": 1.0,
        "ci95": [0.9, 1.1],
        "nominal": 1.0,
        "unit": "V",
        "logarithmic": False,
    }
    (tmp_path / "fit.json").write_text(json.dumps(answer))
    fit = read_fitted(tmp_path / "fit.json", model_of(Line))
    assert fit.differences({"gain": 3.0}) == []
    (line,) = fit.differences({})
    assert "was fitted with gain = 3 ohm; here it is 2 ohm" in line


def test_draws_that_the_model_does_not_allow_are_refused(tmp_path):
    """A gain cannot be negative; a third of these would be."""
    parameter = {
        "value": 1.0,
        "ci95": [1.0 - 2.0 * HALF, 1.0 + 2.0 * HALF],
        "nominal": 1.0,
        "unit": "ohm",
    }
    answer = {
        "fitted": {"parameters": {"gain": parameter | {"logarithmic": False}}, "correlations": []}
    }
    (tmp_path / "fit.json").write_text(json.dumps(answer))
    fit = read_fitted(tmp_path / "fit.json", model_of(Line))
    with pytest.raises(
        UserError, match=r"gain is determined so loosely that (\d+) of 1,000 draws are out of range"
    ) as told:
        fit.draws(1000, 0)
    count = int(str(told.value).split(" of 1,000")[0].split()[-1])
    assert count == pytest.approx(1000 * norm.cdf(-0.5), abs=4.0 * np.sqrt(1000 * 0.31 * 0.69))


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda a: a.pop("fitted"), "holds no fit"),
        (lambda a: a["fitted"].pop("correlations"), "fitted.correlations is missing"),
        (
            lambda a: a["fitted"]["parameters"]["tau"].pop("logarithmic"),
            "fitted.parameters.tau.logarithmic is missing",
        ),
        (lambda a: a["fitted"]["parameters"]["tau"].update(unit="ms"), "tau is in ms"),
        (
            lambda a: a["fitted"]["parameters"]["tau"].update(ci95=[0.5, None]),
            "does not determine tau",
        ),
        (
            lambda a: a["fitted"]["parameters"]["tau"].update(ci95=[-0.5, 1.0]),
            "no positive value and interval",
        ),
        (
            lambda a: a["fitted"]["parameters"].update(R1=a["fitted"]["parameters"].pop("tau")),
            "has no parameter R1",
        ),
        (
            lambda a: a["fitted"]["correlations"].append({"between": ["tau", "R"], "value": 0.5}),
            "not fitted",
        ),
        (
            lambda a: a["fitted"]["correlations"].append({"between": ["tau", "R"], "value": 1.5}),
            "value = 1.5",
        ),
        (lambda a: a.update(fitted=[]), "fitted = []: should be a table"),
        (
            lambda a: a["fitted"]["parameters"].update(tau=[1.0]),
            "fitted.parameters.tau = [1.0]: should be a table",
        ),
    ],
)
def test_a_file_that_is_no_fit_of_the_model_is_refused_in_a_line(folder, tmp_path, change, told):
    answer = json.loads((folder / "fit.json").read_text())
    change(answer)
    (tmp_path / "fit.json").write_text(json.dumps(answer))
    call = [*CALL, "--samples", 5]
    call[1] = folder / "one_state.fmu"
    refused(tmp_path, *call, parts=[told])


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ([], "--samples"),
        (["--samples", "5", "--over", "u=1,2"], "leave out --over"),
        (["--samples", "5", "--design", "sobol"], "leave out --over and --design"),
        (["--samples", "5", "--set", "tau=1"], "swept, and set"),
        (["--samples", "5", "--fitted", "none.json"], "No such file"),
        (["--samples", "0"], "--samples 0: one or more"),
        (["--samples", "5", "--fitted", "r.csv"], "no JSON"),
        (["--samples", "5", "--fitted", "deep.json"], "deep.json: no JSON"),
        (["--samples", "5", "--fitted", "."], "directory"),
    ],
    ids=lambda value: " ".join(value),
)
def test_what_does_not_go_together_is_refused_in_a_line(folder, arguments, told):
    (folder / "deep.json").write_text(100_000 * "[")
    refused(folder, *CALL, *arguments, parts=[told])


def pairs(*pairs):
    return [{"between": pair, "value": 0.5} for pair in pairs]


@pytest.mark.parametrize(
    ("correlations", "told"),
    [
        (pairs(), "the correlation of offset and gain is missing"),
        (pairs(("gain", "gain")), "a correlation of gain with itself"),
        (
            pairs(("gain", "offset"), ("offset", "gain")),
            "the correlation of offset and gain is there twice",
        ),
        (
            pairs(("gain", "offset"), ("gain", "offset")),
            "the correlation of gain and offset is there twice",
        ),
    ],
)
def test_every_pair_has_one_correlation(tmp_path, correlations, told):
    """A missing correlation is not taken for zero."""
    parameter = {"value": 3.0, "ci95": [2.9, 3.1], "nominal": 1.0, "logarithmic": False}
    parameters = {"offset": parameter | {"unit": "V"}, "gain": parameter | {"unit": "ohm"}}
    path = tmp_path / "fit.json"
    path.write_text(
        json.dumps(
            {"fitted": {"parameters": parameters, "correlations": pairs(("gain", "offset"))}}
        )
    )
    drawn = read_fitted(path, model_of(Line)).draws(4000, 1)
    assert np.corrcoef(drawn["offset"], drawn["gain"])[0, 1] == pytest.approx(
        0.5, abs=4.0 * 0.75 / np.sqrt(4000)
    )
    path.write_text(
        json.dumps({"fitted": {"parameters": parameters, "correlations": correlations}})
    )
    with pytest.raises(UserError, match=told):
        read_fitted(path, model_of(Line))
