"""Claims: pictures have units on their axes, and a name says their format."""

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.reporting import pictures
from orchestration.reporting.figure import rendered


@pytest.fixture
def drawn():
    return pictures.panels(2, "r\udce9cord.csv")


def test_panels_share_their_time(drawn):
    figure, (upper, lower) = drawn
    lower.plot([0.0, 7.0], [1.0, 2.0])
    assert upper.get_xlim() == lower.get_xlim()
    assert (upper.get_xlabel(), lower.get_xlabel()) == ("", "time [s]")
    figure.draw_without_rendering()
    assert figure.get_suptitle() == "r\\udce9cord.csv"


def test_a_mosaic_has_its_panels_by_name():
    figure, axes = pictures.mosaic([["magnitude", "plane"], ["phase", "plane"]], "r.csv")
    places = {name: axis.get_position() for name, axis in axes.items()}
    assert set(places) == {"magnitude", "phase", "plane"}
    assert places["plane"].height > 1.5 * places["phase"].height
    assert figure.get_suptitle() == "r.csv"


def test_an_axis_has_the_unit_of_its_signal(drawn):
    _, (upper, lower) = drawn
    pictures.label(upper, "motor_voltage", "V")
    pictures.label(lower, "life_used", "1")
    assert (upper.get_ylabel(), lower.get_ylabel()) == ("motor voltage\n[V]", "life used")


def test_a_name_stays_beside_its_panel(drawn):
    figure, (upper, lower) = drawn
    pictures.label(upper, "imbalance actuator.displacement <-> stand.tension", "J")
    pictures.label(lower, "displacement_measured_at_the_end", "m")
    figure.draw_without_rendering()
    above, below = (axis.yaxis.label.get_window_extent() for axis in (upper, lower))
    assert above.y0 > below.y1
    assert above.x0 > 0.0


@pytest.mark.parametrize(
    ("values", "low", "high"),
    [
        ([0.0, 0.0], -0.5, 0.5),
        ([-2.0, -2.0], -3.0, -1.0),
        ([0.3, 0.1 + 0.2], 0.15, 0.45),
        ([np.nan, 4.0], 2.0, 6.0),
    ],
)
def test_a_constant_is_drawn_where_its_rounding_is_no_noise(drawn, values, low, high):
    _, (upper, _) = drawn
    upper.plot([0.0, 1.0], values)
    pictures.fit_values(upper)
    assert upper.get_ylim() == pytest.approx((low, high))


@pytest.mark.parametrize("values", [[1.0, 1.0 + 1e-9], [np.nan, np.nan]])
def test_an_axis_with_a_course_or_without_values_stays(drawn, values):
    _, (upper, _) = drawn
    upper.plot([0.0, 1.0], values)
    before = upper.get_ylim()
    pictures.fit_values(upper)
    assert upper.get_ylim() == before


@pytest.mark.parametrize("values", [[0.0, 1.0], [1.0, 1.0], [0.0, 0.0]])
def test_values_of_truth_are_false_and_true(drawn, values):
    _, (upper, _) = drawn
    upper.plot([0.0, 1.0], values)
    pictures.fit_values(upper, boolean=True)
    assert [text.get_text() for text in upper.get_yticklabels()] == ["false", "true"]
    assert upper.get_yticks().tolist() == [0.0, 1.0]
    low, high = upper.get_ylim()
    assert -0.2 < low < 0.0 < 1.0 < high < 1.2


def test_a_dollar_is_a_dollar_wherever_a_name_stands_and_powers_of_ten_are_powers(drawn):
    name = "$\\nosuch{$"
    figure, (upper, lower) = pictures.panels(2, name)
    pictures.label(upper, name, "1")
    upper.loglog([1.0, 1e5], [1.0, 1e5], label=name)
    upper.legend(title=name)
    upper.set_title(name)
    pictures.name_ticks(lower.yaxis, [0.0, 1.0], [name, f"{name}\x1b\ud800" + "x" * 10_000])
    for kind in ("png", "svg"):
        assert rendered(figure, kind)
    drawn = {label.get_text() for label in lower.get_yticklabels()}
    assert name in drawn
    assert max(map(len, drawn)) < 300
    assert all(text.isprintable() for text in drawn)
    powers = [label for label in upper.get_yticklabels() if "10^{2}" in label.get_text()]
    assert [label.get_parse_math() for label in powers] == [True]


def test_a_logarithm_has_its_values_written_out(drawn):
    figure, (upper, _) = drawn
    upper.plot([0.0, 1.0], [2.0, 60.0])
    pictures.logarithmic_values(upper)
    figure.draw_without_rendering()
    labels = upper.yaxis.get_ticklabels(which="both")
    assert {"10"} < {label.get_text() for label in labels} - {""} < {str(n) for n in range(101)}


@pytest.mark.parametrize(
    ("time", "scale"),
    [(np.geomspace(1.0, 1e4, 50), "log"), (np.arange(1.0, 50.0), "linear"), ([3.0], "linear")],
)
def test_only_a_record_of_ever_longer_steps_is_drawn_over_a_logarithm(drawn, time, scale):
    """Steps of the first grow with it by 1e4^(48/49), more than the thousand that it takes."""
    _, axes = drawn
    axes[-1].set_xlim(1.0, 2.0)
    pictures.logarithmic(axes, np.array(time))
    assert axes[-1].get_xscale() == scale


@pytest.mark.parametrize(
    ("name", "begins"), [("a.PNG", b"\x89PNG"), ("a.svg", b"<?xml"), ("a.pdf", b"%PDF")]
)
def test_the_ending_is_the_format(drawn, tmp_path, name, begins):
    pictures.save(drawn[0], tmp_path / name)
    assert (tmp_path / name).read_bytes().startswith(begins)


@pytest.mark.parametrize(("name", "said"), [("a.bmp", "'.bmp'"), ("a", "'nothing'")])
def test_another_ending_is_refused_and_nothing_written(drawn, tmp_path, name, said):
    with pytest.raises(UserError, match=f"must end in .png, .svg, .pdf, not {said}"):
        pictures.save(drawn[0], tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("title", ["wide words, " * 20, "omega " * 40, "a" * 240])
def test_a_title_is_not_cut_at_the_edge(title):
    for figure in (pictures.panels(1, title)[0], pictures.mosaic([["a"]], title)[0]):
        figure.draw_without_rendering()
        box = figure._suptitle.get_window_extent()
        assert 0.0 <= box.x0 < box.x1 <= figure.bbox.x1
        assert box.y1 <= figure.bbox.y1
        words = "".join(figure.get_suptitle().split())
        assert words == "".join(title.split())
        assert figure.get_suptitle().count("\n") == 1
