"""Claims: ``ppy info`` says what one needs to use a model."""

import json

from fmus import MODELS
from orchestration.fmu.model import find_class
from tests.support.command import answered, here, works


def test_info_says_what_one_needs_to_set_a_parameter(tmp_path):
    text = works("info", "ppy_actuator", cwd=tmp_path)
    row = next(line for line in text.splitlines() if line.startswith("R2 "))
    for part in ("2.35 ohm", "1e-06 … 1e+12 ohm", "leakage"):
        assert part in row
    row = next(line for line in text.splitlines() if line.startswith("alpha "))
    for part in ("0.068 mm/C", "-1000 … 1000 mm/C"):  # both in the unit people read
        assert part in row
    assert text.split().count("tunable") == 4  # the limits
    assert "inf" not in text.split("parameters")[1].split()
    for part in ("current", "displacement", "five_layer", "table 3-1"):
        assert part in text


def test_the_memory_of_a_delay_is_not_listed(tmp_path):
    late = ("ppy_actuator", "--with", "transport_delay(voltage)")
    plain = listed(answered("info", "ppy_actuator", cwd=tmp_path)["parameters"])
    names = listed(answered("info", *late, cwd=tmp_path)["parameters"]).keys() - plain.keys()
    assert names == {"voltage_delay"}  # nor what the output was before the start


def test_a_terminal_without_unicode_is_served_too(tmp_path):
    assert "R2" in works(
        "info", "ppy_actuator", cwd=tmp_path, environment={"PYTHONIOENCODING": "ascii"}
    )


def listed(answer):
    return {entry["name"]: entry for entry in answer}


def test_json_of_list_and_info(tmp_path):
    done = here("list", "--json", "-", cwd=tmp_path)
    assert list(listed(json.loads(done.stdout))) == list(MODELS)
    about = answered("info", "ppy_actuator", cwd=tmp_path)
    resistance = listed(about["parameters"])["R1"]
    assert (resistance["unit"], resistance["start"], resistance["min"]) == ("ohm", 0.43, 0)
    assert "table 3-1" in resistance["source"]
    assert listed(about["parameters"])["charge_start"]["max"] is None  # without a bound
    assert [s["name"] for s in about["inputs"]] == ["current", "force"]
    assert "strain_saturation" in [e["id"] for e in about["effects"]]
    assert {e["output"] for e in about["effects"] if e["id"] == "sensor_lag"} >= {
        "voltage",
        "displacement",
    }
    assert about["step"] == 0.1


def test_all_effects_that_can_be_named_are_listed_those_of_inputs_too(tmp_path):
    about = answered("info", "ppy_actuator", cwd=tmp_path)
    names = listed(about["effects"])
    families = ("dead_zone", "asymmetric_dead_zone", "input_offset", "input_saturation")
    for family in (*families, "backlash", "input_lag"):
        assert {f"{family}(current)", f"{family}(force)"} <= names.keys()
    for name in names:  # as `--with` takes them
        assert find_class("ppy_actuator", [name]).name != "ppy_actuator", name
    text = works("info", "ppy_actuator", cwd=tmp_path)
    for row in ("backlash(INPUT)", "sensor_lag(OUTPUT)", "INPUT is one of current, force"):
        assert text.count(row) == 1, row
