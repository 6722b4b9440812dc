"""Chapter 5 recomputed: work loops by a solver, the printed matrices, angles and units by other
routes.
"""

import math

import control
import numpy as np
import pytest

from demonstrations.thesis import foot, work_loops
from demonstrations.thesis.printed_foot import printed
from fmus.foot.model import Foot
from fmus.galvanostat.model import Galvanostat
from fmus.kit.units import convert, parse
from tests.support.thesis_findings import claim, claims, row

pytestmark = pytest.mark.slow  # the first test computes the claims of a chapter

K, B, ALPHA = 9.1, 1700.0, 5.0  # N/mm, N s/mm, mm/C
TIME = np.linspace(0.0, 1.0, 20001)


def loop(rate, amplitude=1.5):
    """Length and force as appendix A4 computes them, by ``control`` in place of lsim."""
    relaxation = control.tf([K * B], [B, K])
    speed = -2 * np.pi * np.cos(2 * np.pi * TIME)
    passive = control.forced_response(relaxation, TIME, speed).outputs
    driven = control.forced_response(
        ALPHA * relaxation, TIME, amplitude * np.sin(rate * TIME)
    ).outputs
    return -np.sin(2 * np.pi * TIME), passive - driven


@pytest.mark.parametrize(("rate", "amplitude"), [(13.0, 1.5), (4.1 * np.pi, 1.5), (13.0, 0.0)])
def test_work_loop_is_that_of_the_program(rate, amplitude):
    found, exact = work_loops.work_loop(rate, amplitude), loop(rate, amplitude)
    assert found[0] == pytest.approx(exact[0], abs=1e-12)
    assert found[1] == pytest.approx(exact[1], abs=1e-5)


def test_row_15_what_either_path_takes_up():
    passive, active = loop(0.0, 0.0), loop(4.1 * np.pi)
    taken, given = (
        float(np.sum(0.5 * (f[1:] + f[:-1]) * np.diff(l))) for l, f in (passive, active)
    )
    assert taken == pytest.approx(
        np.pi * K / (2 * np.pi * B / K), rel=0.01
    )  # of a settled Maxwell element
    holds = row(work_loops, 15).holds
    assert f"= 1.5 sin({4.1 * np.pi:.2f} t)" in holds
    assert f"Passive path {taken:.4f} N·mm (±{abs(passive[1]).max():.1f} N)" in holds
    low, high = active[1].min(), active[1].max()
    assert f"active −{-given:.3f} N·mm (−{-low:.2f} to {high:.2f} N)" in holds
    assert [f"{x:.2f}" for x in (given, low, high)] == ["-1.02", "-19.68", "3.13"]
    assert claim(work_loops, "direction of the passive loop").holds
    assert claim(work_loops, "net effect of the current").holds


def test_row_31_the_galvanostat_does_not_give_that_current():
    given = float(Galvanostat(current_command=1.5).outputs()[0])
    assert given == 1.3
    assert (claims(work_loops, 31)[0].published, claims(work_loops, 31)[0].reproduced) == (
        "≤1.3",
        1.5,
    )
    assert f"needs {100 * (1.5 / given - 1):.0f} % more" in row(work_loops, 31).holds


def test_row_32_most_of_the_path_is_compression():
    passive, active = loop(0.0, 0.0)[1], loop(4.1 * np.pi)[1]
    assert passive.max() > 3.0
    assert active.min() < 0.0
    shares = [100 * np.mean(force < 0) for force in (passive, active)]
    assert (
        f"{shares[0]:.0f} % of the one path and {shares[1]:.0f} % of the other"
        in row(work_loops, 32).holds
    )
    ranges = [float(force.max() - force.min()) for force in (passive, active)]
    assert (
        f"ranges of {ranges[0]:.1f} and {ranges[1]:.1f} N between 0 and 3 N"
        in row(work_loops, 32).holds
    )
    assert [c.reproduced for c in claims(work_loops, 32)] == pytest.approx(ranges, abs=1e-4)
    assert min(ranges) > 3.0


def test_row_33_the_path_does_not_close():
    gaps = [loop(rate)[1][-1] for rate in (13.0, 4.1 * np.pi)]
    assert f"{-gaps[0]:.2f} N ({-gaps[1]:.2f} N) below its start" in row(work_loops, 33).holds
    assert claims(work_loops, 33)[0].reproduced == pytest.approx(gaps[0], abs=1e-5)
    assert (
        abs(loop(4 * np.pi)[1][-1]) < 0.1 * abs(gaps[1]) + 0.05
    )  # two whole periods all but close


# --- matrices
# --------------------------------------------------------------------------------------------------


def test_row_35_the_compliance_of_a_foot_does_not_depend_on_its_size():
    """Stiffnesses alone and lengths all alike: arms and Jacobian scale alike, so that C does not
    scale.
    """
    stiff = 1e9  # the arch, which is no actuator
    sizes = [Foot(scale=scale, tm_stiffness=stiff).compliance(0, 0) for scale in (1.0, 2.5)]
    assert sizes[0] == pytest.approx(sizes[1], rel=1e-4)
    grown = [printed(unit, 1e-4 * unit).compliance[0, 0] for unit in (10.0, 100.0)]
    assert math.log10(grown[1] / grown[0]) == pytest.approx(4.0, abs=1e-3)
    assert claims(foot, 35)[0].reproduced == pytest.approx(4.0)
    assert "to the power 4" in row(foot, 35).holds


def test_row_35_the_other_entries_divide_by_the_radius():
    """Entry of `do` by finite differences of its triangle: an inverse length, twice the size is
    half the entry.
    """
    entries = []
    for size in (1.0, 2.0):
        radius, reference, angle = 0.91 * size, 4.46 * size, math.radians(15.064)
        base = math.sqrt(radius**2 + reference**2 - 2 * radius * reference * math.cos(angle))

        def joint(length, radius=radius, base=base):
            return math.acos((base**2 + radius**2 - length**2) / (2 * base * radius))

        step = 1e-6 * size
        entries.append((joint(reference + step) - joint(reference - step)) / (2 * step))
        assert abs(entries[-1]) == pytest.approx(1 / (radius * math.sin(angle)), rel=1e-6)
    assert entries[0] == pytest.approx(2 * entries[1], rel=1e-6)


def test_row_36_the_damping_is_the_compliance_once_more():
    c, d = np.array([[1081, 9.6], [9.6, 7.3]]), np.array([[1.7e7, 1.5e5], [1.5e5, 1.1e5]])
    product = 9.1 * 1700
    assert d / c == pytest.approx(np.full((2, 2), product), rel=0.04)  # to the printed digits
    assert f"k b = {product:g}" in row(foot, 36).holds
    assert claims(foot, 36)[0].reproduced == "C_x"


def test_row_37_the_damping_is_larger_along_y():
    """Force at the toe per velocity, from the power that the dampers take: J^-T R^T B R J^-1."""
    body = Foot()
    jacobian = np.array([body.jacobian()[0], body.jacobian()[2]]).T
    an, po, do, pl = body.arms()
    joints = np.diag([1.7e6 * (an**2 + po**2), 1.7e6 * (do**2 + pl**2)])
    inverse = np.linalg.inv(jacobian)
    damping = inverse.T @ joints @ inverse
    assert foot.consistent()[1] == pytest.approx(damping * 1e-3, rel=1e-9)
    assert f"{damping[1, 1] / damping[0, 0]:.1f} times larger along y" in row(foot, 37).holds
    assert f"{1.672e7 / 1.132e5:.0f} times larger along x" in row(foot, 37).holds
    assert (claims(foot, 37)[0].published, claims(foot, 37)[0].reproduced) == ("y", "x")


def test_row_12_and_13_say_what_the_foot_gives():
    found = printed()
    assert (
        "[[1080.78, 9.554], [9.554, 7.315]] and [[1.672e7, 1.478e5], [1.478e5, 1.132e5]]"
        in row(foot, 12).holds
    )
    assert f"by {found.compliance[0, 0]:.0f} mm" in row(foot, 12).holds
    assert [c.verdict for c in claims(foot, 12)] == ["only as printed"] * 8
    assert [
        claim(foot, f"{m}_xx over {m}_yy, two orders of magnitude").reproduced for m in "CD"
    ] == pytest.approx([1080.78 / 7.315, 1.672e7 / 1.132e5], rel=1e-3)
    body = Foot()
    stiffness = [9100 * (body.arms()[i] ** 2 + body.arms()[i + 1] ** 2) for i in (0, 2)]
    assert (
        f"{stiffness[0]:.2f} N·m/rad and the toe {stiffness[1]:.2f} N·m/rad" in row(foot, 13).holds
    )


def test_row_29_antagonists_ask_for_two_angles():
    """Angles at which the triangles of table 5-1 have the lengths of 0.25 s, found by bisection in
    the plane.
    """
    angles = []
    for length, radius, angle, change, sign in (
        (97.5, 18.0, 50.7 - 6.1, -1.0, -1),
        (93.2, 41.7, 57.7 - 12.9, 1.0, 1),
        (113.3, 23.1, 15.1, -2.0, -1),
    ):
        # attachment at `radius` from the joint on the x axis; the actuator leaves it at `angle`
        # from the radius
        origin = np.array(
            [
                radius - length * math.cos(math.radians(angle)),
                length * math.sin(math.radians(angle)),
            ]
        )
        low, high = 0.0, 40.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            turn = -sign * math.radians(middle)
            attachment = radius * np.array([math.cos(turn), math.sin(turn)])
            moved = np.linalg.norm(origin - attachment) - length
            low, high = (
                (middle, high) if moved * math.copysign(1, change) < abs(change) else (low, middle)
            )
        angles.append(low)
    angles.append(math.degrees(2.0 / 16.3))  # the tendon on its radius
    for asked in angles:
        assert f"{asked:.1f}°" in row(work_loops, 29).holds
    assert angles[0] > 2 * angles[1]
    assert angles[2] > 1.9 * angles[3]


def test_row_17_units_of_the_symbol_list():
    current, speed = parse("A"), parse("m/s")
    motors = row(foot, 17).printed.split("in ")[1].split(";")[0].split(" or ")
    coils = row(foot, 17).holds.split("the coil's are ")[1].split(". ")[0].split(" or ")
    for units, right in ((motors, False), (coils, True)):
        constant, back_emf = (parse(unit.replace("·", "*")) for unit in units)
        assert constant.dimensionality == back_emf.dimensionality
        assert ((constant * current).dimensionality == parse("N").dimensionality) is right
        assert ((back_emf * speed).dimensionality == parse("V").dimensionality) is right
    body, step = Foot(), math.radians(1e-3)
    before = body.toe_position()[0]
    body.ankle_angle = step
    per_rad = (body.toe_position()[0] - before) / step
    assert Foot().jacobian()[0][0] == pytest.approx(per_rad, rel=1e-4)
    assert f"{math.degrees(1.0):.1f} times too large" in row(foot, 17).holds


def test_table_5_1_is_the_program_in_millimetres():
    found = {c.what: c for c in (claim(foot, symbol, "table 5-1") for symbol in foot.TABLE)}
    assert len(found) == 19
    for symbol, c in found.items():
        value = foot.TABLE[symbol][1]
        assert c.reproduced == pytest.approx(
            convert(value, "in", "mm") if symbol[0] in "lr" else value, rel=1e-12
        )
        assert c.holds


def test_table_5_1_is_what_the_component_has():
    defaults = {p.name: p.start for p in Foot.layout.parameters}
    for symbol, (text, _) in foot.TABLE.items():
        name = symbol.replace(",0", "").replace("l_1", "l1").replace("l_2", "l2")
        value = defaults[name.replace("l_3", "l3")]
        assert convert(
            value, "m" if symbol[0] in "lr" else "rad", "mm" if symbol[0] in "lr" else "deg"
        ) == pytest.approx(float(text), rel=1e-9)
