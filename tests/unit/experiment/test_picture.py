"""Claims: a picture of an experiment has units on every axis, and constant signals are flat."""

import pytest

from orchestration.experiment.execution import run
from orchestration.experiment.reading import read
from tests.support.command import PNG
from tests.support.experiments import played_record


@pytest.fixture
def folder(tmp_path):
    return played_record(tmp_path)


def test_a_constant_input_and_a_boolean_have_axes_that_show_no_noise(tmp_path):
    (tmp_path / "still.toml").write_text(
        'component = "displacement_controller"\nduration = 1\nstep = 0.1\n[inputs]\nhold = 1\n',
        encoding="utf-8",
    )
    figure = run(read(str(tmp_path / "still.toml"))).plot()
    axes = {axis.get_ylabel().split("\n")[0]: axis for axis in figure.axes}
    assert [text.get_text() for text in axes["hold"].get_yticklabels()] == ["false", "true"]
    for axis in axes.values():
        low, high = axis.get_ylim()
        assert high - low > 0.2


@pytest.mark.parametrize("over", ["time", "current"])
def test_a_picture_has_units_on_every_axis(folder, over):
    done = run(read(str(folder / "play.toml"), [f"over={over}"]))
    figure = done.plot(folder / "run.png")
    labels = {axis.get_ylabel().replace("\n", " ") for axis in figure.axes}
    expected = {"current [A]", "force [N]", "voltage [V]", "displacement [mm]"} - {f"{over} [A]"}
    assert labels == expected
    assert figure.axes[-1].get_xlabel() == ("time [s]" if over == "time" else "current [A]")
    drawn = (
        next(a for a in figure.axes if a.get_ylabel().startswith("displacement"))
        .lines[0]
        .get_ydata()
    )
    assert drawn == pytest.approx(1e3 * done.displacement.values)
    assert (folder / "run.png").read_bytes().startswith(PNG)
