"""Claims: values of a file are read with their units, written back as they were, and refused in
words that say what is allowed.
"""

import pytest
from pydantic import TypeAdapter, ValidationError

from fmus.kit import UserError
from orchestration.experiment.values import (
    Amount,
    File,
    Hertz,
    QuantityValue,
    Seconds,
    Span,
    ValueTable,
)


@pytest.mark.parametrize(
    ("kind", "given", "value"),
    [
        (Amount, "500 mA", QuantityValue(500.0, "mA")),
        (Amount, "3.6km/h", QuantityValue(3.6, "km/h")),
        (Amount, 2, QuantityValue(2.0)),
        (Span, "2 min", 120.0),
        (Span, 0.5, 0.5),
        (Seconds, "-250 ms", -0.25),
        (Hertz, "300 mHz", 0.3),
    ],
)
def test_values_with_and_without_a_unit(kind, given, value):
    assert TypeAdapter(kind).validate_python(given) == pytest.approx(value)


@pytest.mark.parametrize(
    ("kind", "given", "says"),
    [
        (Span, 0, "must be above 0"),
        (Hertz, "-1 Hz", "must be above 0"),
        (Span, "2 V", "'V' cannot be converted to 's'"),
        (Amount, "5 wexs", "unknown unit 'wexs'"),
        (Amount, "much", "a finite number is needed"),
        (Amount, float("inf"), "a finite number is needed"),
        (Amount, True, "a finite number is needed"),
        (Amount, [1], "a finite number is needed"),
    ],
)
def test_what_is_no_such_value_is_refused(kind, given, says):
    with pytest.raises(ValidationError, match=says):
        TypeAdapter(kind).validate_python(given)


def test_a_quantity_is_converted_and_one_without_a_unit_has_that_of_its_variable():
    assert QuantityValue(500.0, "mA").to("A") == pytest.approx(0.5)
    assert QuantityValue(500.0).to("A") == 500.0
    with pytest.raises(UserError, match="'V'"):
        QuantityValue(1.0, "V").to("A", "amplitude")


@pytest.mark.parametrize("given", ["500.0 mA", 2.0])
def test_an_amount_is_written_as_it_was_given(given):
    amounts = TypeAdapter(Amount)
    assert amounts.dump_python(amounts.validate_python(given)) == given


def test_a_file_is_looked_for_beside_the_experiment_first(tmp_path, monkeypatch):
    (tmp_path / "beside").mkdir()
    (tmp_path / "beside" / "near.csv").touch()
    monkeypatch.chdir(tmp_path)
    found = TypeAdapter(File)
    context = {"folder": str(tmp_path / "beside")}
    near, far = (found.validate_python(f"{n}.csv", context=context) for n in ("near", "far"))
    assert near == str(tmp_path / "beside" / "near.csv")
    assert far == str(tmp_path / "far.csv")
    assert found.validate_python("ppy_actuator", context=context) == "ppy_actuator"
    assert found.validate_python("near.csv") == "near.csv"


def test_an_unknown_key_is_refused_with_what_was_probably_meant():
    class Named(ValueTable):
        amplitude: float = 0.0

    with pytest.raises(ValidationError, match=r"unknown key 'amplitud' \(did you mean amplitude"):
        Named.model_validate({"amplitud": 1.0})
