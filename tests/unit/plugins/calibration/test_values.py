"""Values of a calibration file: what is refused is told in a line with what is allowed."""

from __future__ import annotations

import pytest

from fmus.kit.errors import UserError
from orchestration.plugins.calibration.values import (
    Interval,
    NotZero,
    Positive,
    Sign,
    TomlTable,
    checked,
)


class Scale(TomlTable):
    """A table with a key of each kind."""

    length: Positive
    factor: NotZero = 1.0
    span: Interval = (0.0, 1.0)
    side: Sign = 1


def test_a_table_has_the_values_of_the_file() -> None:
    scale = checked(Scale, {"length": 2, "span": [-1, 1.5]}, "")
    assert (scale.length, scale.factor, scale.span, scale.side) == (2.0, 1.0, (-1.0, 1.5), 1)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({}, "length is missing: a finite number above 0 is wanted"),
        ({"length": 0.0}, "length = 0.0: a finite number above 0 is wanted"),
        ({"length": True}, "length = True: a finite number above 0 is wanted"),
        ({"length": "x" * 99}, f"length = '{'x' * 59}: a finite number above 0 is wanted"),
        ({"length": 1, "factor": 0}, "factor = 0: must not be zero"),
        ({"length": 1, "span": [1, 1]}, "span = [1, 1]: [low, high] of two finite numbers"),
        ({"length": 1, "side": 1.0}, "side = 1.0: 1 or -1 is wanted"),
        ({"length": 1, "lenght": 1}, "lenght = 1: there is no such key (did you mean length?)"),
    ],
)
def test_a_wrong_value_is_told_with_what_is_allowed(
    values: dict[str, object], message: str
) -> None:
    with pytest.raises(UserError) as caught:
        checked(Scale, values, "rig.toml: [scale] ")
    assert str(caught.value).startswith(f"rig.toml: [scale] {message}")
