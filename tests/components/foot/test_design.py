"""Claims: force and stroke of the toe are those of springs and points that are balanced."""

import numpy as np
import pytest

from fmus.foot.design import FootDesign
from tests.support.foot import lengths_at, one_by_one, toe_at


def balanced(values):
    """Gains of ankle and toe joint, from differences of points: work of a tension is that of a
    force.
    """
    h = 1e-6
    gains = []
    for joint, actuator in ((0, 1), (2, 3)):
        step = h * np.eye(3)[joint]
        posture = np.array(list(values.values()))
        forth, back = posture + step, posture - step
        toe = (toe_at(*forth) - toe_at(*back)).real
        length = lengths_at(forth[0], forth[2])[actuator] - lengths_at(back[0], back[2])[actuator]
        gains.append(-length / toe)
    return gains


def test_force_and_stroke_are_virtual_work_of_points():
    for values in one_by_one(50):
        a, b = balanced(values)
        foot = FootDesign(**values)
        if b < 0.0:
            continue  # the toe points so far up that its joint presses it up
        assert foot.ankle_limited_force() == pytest.approx(3.0 * a, rel=1e-7)
        if b < 100.0:
            assert foot.toe_limited_force() == pytest.approx(3.0 * b, rel=1e-6)
            assert foot.toe_stroke() == pytest.approx(1.8e-4 * (1.0 / a + 1.0 / b), rel=1e-6)
        assert foot.toe_force() == pytest.approx(3.0 * min(a, b), rel=1e-6)


def test_a_toe_along_the_leg_still_has_numbers():
    """A toe's joint without a lever carries any force and does not move the toe."""
    foot = FootDesign(mtp_angle=np.pi / 2)
    assert np.isfinite([foot.toe_limited_force(), foot.toe_stroke()]).all()
    assert foot.toe_force() == foot.ankle_limited_force()
