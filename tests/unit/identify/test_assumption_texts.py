"""Claims: assumptions of a fit are read from texts with units and from numbers.

Oracle: the units, converted by hand.
"""

from dataclasses import replace

import pytest

from fmus.kit import UserError
from orchestration.api import as_measured
from orchestration.api.declaration import options_of
from orchestration.api.options import AssumptionOptions
from orchestration.identify import read_assumptions

DEFAULTS = {name: option.default for name, option in options_of(AssumptionOptions).items()}


def read(**given):
    return read_assumptions(as_measured("ppy_actuator"), DEFAULTS | given)


@pytest.mark.parametrize(
    "text", ["430+-50mohm", "0.43+-0.05ohm", "0.43 ± 0.05 ohm", "0.43ohm+/-50mohm", (0.43, 0.05)]
)
def test_a_prior_has_a_mean_and_a_deviation(text):
    assert read(prior={"R1": text}).priors["R1"] == pytest.approx((0.43, 0.05))


@pytest.mark.parametrize(
    ("text", "ends"),
    [("0.1..2ohm", (0.1, 2.0)), ("100mohm..2ohm", (0.1, 2.0)), ((0.1, 2.0), (0.1, 2.0))],
)
def test_bounds_have_two_ends(text, ends):
    assert read(bounds={"R1": text}).bounds["R1"] == pytest.approx(ends)


def test_an_end_of_bounds_may_be_left_out():
    declared = as_measured("ppy_actuator").constants["R1"]
    assert read(bounds={"R1": "0.1.."}).bounds["R1"] == (0.1, declared.max)
    assert read(bounds={"R1": "..2ohm"}).bounds["R1"] == (declared.min, 2.0)


@pytest.mark.parametrize("given", ["1.6*k1", " 1.6 * k1", (1.6, "k1")])
def test_a_tie_has_a_factor_and_a_name(given):
    assert read(tie={"b1": given}).ties == {"b1": (1.6, "k1")}


def test_a_tie_without_a_factor_is_equality():
    assert read(tie={"b1": "k1"}).ties == {"b1": (1.0, "k1")}


def test_noise_is_a_deviation_in_the_unit_of_its_output():
    assert read(noise={"voltage": "2mV"}).noise == {"voltage": pytest.approx(0.002)}


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"prior": {"R1": "0.43"}}, "write it as 0.43+-0.05ohm"),
        ({"prior": {"R1": "0.43+-0.05V"}}, "R1"),
        ({"prior": {"Rx": "0.43+-0.05"}}, "Rx"),
        ({"bounds": {"R1": "3"}}, "write it as 0.1..2ohm"),
        ({"bounds": {"R1": (1.0,)}}, "must be two numbers"),
        ({"tie": {"b1": "0*k1"}}, "write a multiple of a fitted parameter"),
        ({"scale": {"R1": "root"}}, "logarithmic or linear"),
        ({"weights": {"voltage": [1.0, -1.0]}}, "from zero on"),
    ],
)
def test_other_texts_are_refused_in_a_line(given, told):
    with pytest.raises(UserError) as refused:
        read(**given)
    assert told in str(refused.value)
    assert "\n" not in str(refused.value)


def test_inputs_without_equations_cannot_be_linear():
    assert read(interpolate=True).linear
    hidden = replace(as_measured("ppy_actuator"), cls=None)
    with pytest.raises(UserError, match=r"interpolate=True: inputs of ppy_actuator are constant"):
        read_assumptions(hidden, DEFAULTS | {"interpolate": True})
