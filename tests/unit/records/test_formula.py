"""Claims: a formula gives what Python gives for the same numbers, in the unit of its columns;
what is no formula of the columns is refused, and nothing of it runs.
"""

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.records import parse_mapping, read_record
from tests.support.record_forms import write

I = np.array([1.0, -2.0, 0.5, 4.0])
U = np.array([2.0, 4.0, 8.0, 16.0])
TEXT = "time [s],I [mA],U [V],P [W],x,I-V [V],T [degC]\n" + "".join(
    f"{k},{I[k]},{U[k]},{U[k] * 3.0},{k + 1},{k},{20 + k}\n" for k in range(4)
)
X = np.arange(1.0, 5.0)


def read(folder, entry, unit="A"):
    mapping = parse_mapping([entry])
    return read_record(write(folder, TEXT), {"current": unit}, mapping=mapping)


@pytest.mark.parametrize(
    ("formula", "unit", "expected"),
    [
        ("-I", "A", -1e-3 * I),
        ("0.001*I", "A", 1e-6 * I),
        ("P/U", "A", np.full(4, 3.0)),
        ("P / U + I", "A", 3.0 + 1e-3 * I),
        ("-(P - U*I)/U", "A", -(3.0 - 1e-3 * I)),
        ("2*x*x - x/2", "A", 2 * X * X - X / 2),
        ("-x - -x*3", "A", 2 * X),
        ("-I-V", "V", -np.arange(4.0)),
        ("1*T", "K", 293.15 + np.arange(4.0)),
        ("2.5e-1*x", "A", 0.25 * X),
        ("0.001*I[A]", "A", 1e-3 * I),
    ],
)
def test_a_formula_is_what_it_says_in_the_units_of_its_columns(tmp_path, formula, unit, expected):
    record = read(tmp_path, f"current={formula}", unit)
    np.testing.assert_allclose(record.signals["current"], expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("formula", "says"),
    [
        ("-Z", "there is no column 'Z'"),
        ("P + U*1", "V cannot be added to W"),
        ("-(I", "a bracket is not closed"),
        ("-I I", "'I' is left over"),
        ("2*", "something is missing"),
        ("P/P", "cannot be converted to A"),
        ("1*__import__('os')", "no column '__import__'"),
        ("-" * 80 + "I", "deeper than 50"),
        ("2**I", "'*' is unexpected"),
    ],
)
def test_what_is_no_formula_of_columns_is_refused(tmp_path, formula, says):
    with pytest.raises(UserError) as caught:
        read(tmp_path, f"current={formula}")
    assert says in str(caught.value)


def test_a_value_divided_by_zero_is_missing(tmp_path):
    record = read(tmp_path, "current=P/I-V")
    assert np.flatnonzero(np.isnan(record.signals["current"])).tolist() == [0]
