"""Claims: any co-simulation FMU runs, its failures are one readable line, and nothing is left
behind.
"""

import numpy as np
import pytest

from fmus.kit import UserError
from fmus.kit.units import format_difference, format_value
from orchestration.fmu.instance import Fmu
from orchestration.fmu.model import find_model
from orchestration.fmu.simulation import simulate_instance
from tests.support.archive import edited

TIME = np.linspace(0.0, 30.0, 61)


def test_a_start_time_other_than_zero(fmu, runtime):
    results = []
    for start in (0.0, -7.25):
        with Fmu(fmu("ppy_actuator", runtime)) as instance:
            instance.start(start)
            results.append(
                simulate_instance(instance, TIME + start, {"force": np.full(TIME.size, 2.0)})
            )
    for output, values in results[0].items():
        assert results[1][output] == pytest.approx(values, rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("fails", [False, True])
def test_the_unzipped_folder_is_removed(fmu, scratch, fails):
    try:
        with Fmu(fmu("ppy_actuator", "native"), {"C": 0.0} if fails else {}) as instance:
            assert len([path for path in scratch.iterdir() if path.is_dir()]) == 1
            instance.start()
    except UserError:
        assert fails
    assert list(scratch.iterdir()) == []


def test_a_refused_parameter_is_told_in_the_words_of_the_fmu(fmu, runtime):
    with (
        Fmu(fmu("ppy_actuator", runtime), {"C": 0.0}) as instance,
        pytest.raises(UserError) as caught,
    ):
        instance.start()
    assert str(caught.value).startswith("ppy_actuator.fmu: initialization failed: ")
    for part in ("'C'", "0 F", "outside its range [1e-09, 1"):
        assert part in str(caught.value)


def test_a_failing_step_is_told_with_its_time(fmu, runtime):
    with Fmu(fmu("ppy_actuator", runtime)) as instance:
        instance.start()
        with pytest.raises(
            UserError, match=r"ppy_actuator\.fmu: (step from 2 s returned|setting current failed)"
        ):
            simulate_instance(
                instance, np.arange(5.0), {"current": np.array([0.0, 1.0, np.nan, 0.0, 0.0])}
            )


def test_names_that_do_not_fit_are_told(fmu):
    path = fmu("ppy_actuator", "native")
    with Fmu(path) as instance:
        instance.start()
        with pytest.raises(
            UserError, match=r"no variable named 'curent' \(did you mean current\?\)"
        ):
            simulate_instance(instance, TIME, {"curent": TIME})
        with pytest.raises(UserError, match="voltage is not an input; inputs are current, force"):
            simulate_instance(instance, TIME, {"voltage": TIME})
    with (
        Fmu(path, {"voltage": 1.0}) as instance,
        pytest.raises(UserError, match="voltage is output, only parameters"),
    ):
        instance.start()


def test_values_that_their_type_cannot_hold_never_reach_the_fmu(thermostat):
    with (
        Fmu(thermostat, {"stages": 2.5}) as instance,
        pytest.raises(UserError, match=r"stages: 2\.5 is not a whole"),
    ):
        instance.start()
    with Fmu(thermostat) as instance:
        instance.start()
        boost = np.array([0.0, 1.0, 0.5, 0.0])
        with pytest.raises(
            UserError, match=r"boost: 0.5 is neither true \(1\) nor false \(0\) \(at 2 s\)"
        ):
            simulate_instance(instance, np.arange(4.0), {"boost": boost})


def test_differences_are_shown_without_the_offset_of_a_unit(thermostat):
    temperature = find_model(str(thermostat)).outputs["temperature"]
    assert format_value(290.0, temperature) == "16.85 degC"
    assert format_difference(2.0, temperature) == "2 K"


def test_a_saved_state_is_returned_to(fmu, runtime):
    """The same three steps, twice, give the same bits; in between the instance went elsewhere."""
    with Fmu(fmu("ppy_actuator", runtime)) as instance:
        instance.start()
        write, read = (
            instance.writer(["current", "force"]),
            instance.reader(["voltage", "displacement"]),
        )

        def advance(current):
            write(np.array([current, 1.0]))
            for k in range(3):
                instance.step(1.0 + 0.5 * k, 0.5)
            row = np.empty(2)
            read(row)
            return row.tolist()

        write(np.array([0.3, 2.0]))
        instance.step(0.0, 1.0)
        state = instance.save()
        first = advance(0.9)
        instance.restore(state)
        elsewhere = advance(-0.9)
        instance.restore(state)
        assert advance(0.9) == first != elsewhere
        instance.release(state)


def test_an_fmu_that_cannot_save_its_state_says_so(fmu, tmp_path):
    def edit(name, contents):
        return name, contents.replace(
            b'canGetAndSetFMUstate="true"', b'canGetAndSetFMUstate="false"'
        )

    with Fmu(edited(fmu("ppy_actuator", "native"), tmp_path / "other.fmu", edit)) as instance:
        instance.start()
        with pytest.raises(UserError, match=r"other\.fmu: cannot save its state"):
            instance.save()


def test_a_working_folder_that_is_gone_is_one_readable_line(fmu, tmp_path, scratch, monkeypatch):
    path, gone = fmu("ppy_actuator", "native"), tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    try:
        with pytest.raises(UserError, match="cannot be loaded"), Fmu(path):
            pass
    finally:
        monkeypatch.chdir(tmp_path)
    assert list(scratch.iterdir()) == []
