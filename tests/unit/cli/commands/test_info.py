"""Claims: ``ppy info`` says what one needs to use a model."""

from tests.support.command import works


def test_info_says_what_one_needs_to_set_a_parameter(tmp_path):
    text = works("info", "ppy_actuator", cwd=tmp_path)
    row = next(line for line in text.splitlines() if line.startswith("R2 "))
    for part in ("2.35 ohm", "1e-06 … 1e+12 ohm", "leakage"):
        assert part in row
    row = next(line for line in text.splitlines() if line.startswith("alpha "))
    for part in ("0.068 mm/C", "-1000 … 1000 mm/C"):  # both in the unit people read
        assert part in row
    assert "inf" not in text.split("parameters")[1].split()
    for part in ("current", "displacement", "five_layer", "table 3-1"):
        assert part in text


def test_a_terminal_without_unicode_is_served_too(tmp_path):
    assert "R2" in works(
        "info", "ppy_actuator", cwd=tmp_path, environment={"PYTHONIOENCODING": "ascii"}
    )
