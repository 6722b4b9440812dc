"""Claims: on public records beside an engineer's first model the cause is one that was expected
before any run, and the extended model is as good on held-out data as one with what was expected.

Oracles: the manifests of the records, in which both were written down before.
"""

from dataclasses import dataclass

import numpy as np
import pytest

import ppy_rig as ppy


@dataclass(frozen=True)
class Expected:
    """A record with its first model, and what its manifest says.

    Attributes
    ----------
    folder, records, model : str
        Records are names without their ending.
    causes : str
        Any of these is right.
    error : float
        Of a model with what was expected, in what was held out, over its spread.
    held_out : str
        A record; by default the end of the record itself.
    """

    folder: str
    records: str
    model: str
    causes: str
    error: float
    held_out: str = ""

    def __str__(self) -> str:
        return f"{self.records.split()[0]}, {self.model}"


NAMED = [
    Expected(
        "wild4", "cell_U_05C cell_U_2C", "cell:Cell", "open_voltage(drawn)", 0.0625, "cell_U_1C"
    ),
    Expected(
        "wild4", "cell_T_05C cell_T_2C", "cellheat:CellHeat", "heating(drawn)", 0.0975, "cell_T_1C"
    ),
    Expected("wild4", "damper", "damper:Damper", "viscous(velocity)", 0.073),
    Expected("wild4", "pulse", "pulse:Pulse", "relaxed_rate(current) ohmic(current)", 0.65),
    Expected("wild4", "exchanger", "exchanger:Exchanger", "outlet_rate(flow)", 0.372),
    Expected("wild", "hoop_random", "hoop:Hoop", "drive(command)", 0.043, "hoop_fixed"),
    Expected(
        "wild",
        "pendulum_ddp",
        "pendulum:Pendulum",
        "friction(velocity)",
        0.147,
        "pendulum_collocation",
    ),
    Expected(
        "wild",
        "pendulum_ddp",
        "pendulum_listed:Pendulum",
        "coulomb_friction stribeck_friction sliding_friction friction(velocity)",
        0.147,
        "pendulum_collocation",
    ),
    Expected("wild", "drone_steps", "drone:Drone", "thrust(throttle)", 0.107, "drone_multisine"),
    Expected("wild", "armadillo", "armadillo:House", "room_rate(heating)", 0.344),
    Expected("wild", "mr_damper", "mr_damper:Damper", "viscous(velocity)", 0.218),
]
GUESSED = Expected("wild4", "beam", "beam:Ball", "slope(angle) slope()", 1.19)


def diagnosed(expected, public_data):
    """Return the diagnosis of a record, and the errors of its best model in what was held out."""
    folder = expected.folder
    paths = [public_data(f"{folder}/{name}.csv") for name in expected.records.split()]
    file, _, name = expected.model.partition(":")
    model = f"{public_data(f'{folder}/models/{file}.py')}:{name}"
    held_out = [public_data(f"{folder}/{expected.held_out}.csv")] if expected.held_out else []
    result = ppy.diagnose(paths, model, holdout=held_out)
    return result, np.sqrt(np.mean(np.square(list(result.gain.after.values()))))


@pytest.mark.slow
@pytest.mark.parametrize("expected", NAMED, ids=str)
def test_the_cause_is_one_that_was_expected(expected, public_data):
    result, error = diagnosed(expected, public_data)
    assert result.verdict in {"cause", "ambiguous"}
    assert set(result.probabilities) & set(expected.causes.split())
    assert error <= 1.1 * expected.error


@pytest.mark.slow
def test_what_is_not_sure_is_a_guess(public_data):
    """The first guess is one that was expected, and is not claimed."""
    result, _ = diagnosed(GUESSED, public_data)
    assert result.verdict == "unexplained"
    assert next(iter(result.probabilities)) in GUESSED.causes.split()
