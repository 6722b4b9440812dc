"""Effects of the foot: the base model to the bit at neutral, virtual work, capstans and Newton's
law elsewhere.
"""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fmus
from fmus.foot.effects import EFFECTS
from fmus.foot.model import Foot, FootDisplacementDriven, FootDynamic, FootFree
from fmus.kit import stack
from fmus.kit.integrate import Integrator
from studies.plants.foot import Foot as Stand
from studies.plants.foot import moving, turning
from tests.support.builds import check_that_bad_values_are_refused, check_that_builds_agree
from tests.support.completeness import Listed, check_described
from tests.support.foot import lengths_at, toe_at
from tests.support.laws import check_neutral, in_graph, named

ACTUATORS, JOINTS = ("an", "po", "do", "pl"), ("ankle", "tm", "mtp")
ACTIVE = Listed(
    "ACTIVE",
    __name__,
    {
        "plantar_tendon_across_arch": {"pl_arch_radius": 0.011},
        "tension_stiffness": {"tension_stiffness_share": 0.7},
        "tendon_stretch": {"tendon_compliance": 2e-4, "tendon_time": 0.04},
        "tendon_friction": {"tendon_wrap_friction": 0.2, "tendon_friction_velocity": 2e-3},
        "coulomb_friction(ankle_friction)": {
            "ankle_friction_coulomb": 4e-3,
            "ankle_friction_coulomb_velocity": 0.05,
        },
        "coulomb_friction(tm_friction)": {
            "tm_friction_coulomb": 5e-3,
            "tm_friction_coulomb_velocity": 0.04,
        },
        "coulomb_friction(mtp_friction)": {
            "mtp_friction_coulomb": 3e-4,
            "mtp_friction_coulomb_velocity": 0.03,
        },
    },
    "values of its parameters at which it acts",
)
_LENGTHS = {f"{a}_length{end}" for a in ACTUATORS for end in ("", "_change", "_rate")}
CHANGED = Listed(
    "CHANGED",
    __name__,
    {
        "plantar_tendon_across_arch": {n for n in _LENGTHS if n.startswith("pl")}
        | {"tm_torque", *(f"toe_compliance_{e}" for e in ("xx", "xy", "yy"))},
        "tension_stiffness": {f"toe_compliance_{e}" for e in ("xx", "xy", "yy")},
        "tendon_stretch": _LENGTHS,
        "tendon_friction": {"ankle_torque", "mtp_torque"},
    }
    | {f"coulomb_friction({joint}_friction)": set() for joint in JOINTS},
    "the rates and outputs that it changes",
)
MOVED = Listed(
    "MOVED",
    __name__,
    {
        "plantar_tendon_across_arch": {"tm"},
        "tension_stiffness": set(),
        "tendon_stretch": set(),
        "tendon_friction": {"ankle", "mtp"},
    }
    | {f"coulomb_friction({joint}_friction)": {joint} for joint in JOINTS},
    "joints of the moving foot that it accelerates",
)
CASES = [(base, name) for base in (Foot, FootDynamic) for name in fmus.effects(base.name)]
cases = pytest.mark.parametrize(("base", "name"), CASES, ids=lambda v: getattr(v, "name", v))
bases = pytest.mark.parametrize("base", [Foot, FootDynamic], ids=lambda cls: cls.name)
feet = pytest.mark.parametrize(
    "base", [Foot, FootDynamic, FootFree, FootDisplacementDriven], ids=lambda cls: cls.name
)
LOADS = (
    {f"{actuator}_tension": (0.1, 2.0) for actuator in ACTUATORS}
    | {f"{actuator}_displacement": (-3e-4, 3e-4) for actuator in ACTUATORS}
    | dict.fromkeys(("toe_force_x", "toe_force_y"), (-0.5, 0.5))
)
POSTURE = {f"{joint}_angle": (-0.14, 0.25) for joint in JOINTS} | {
    f"{joint}_rate": (-1.0, 1.0) for joint in JOINTS
}


def ranges_of(cls, ranges):
    """Ranges of the variables that a component has."""
    known = {v.name for v in cls.layout.variables}
    return {name: ends for name, ends in ranges.items() if name in known}


def drawn(cls, seed, **values):
    """Parameters about their defaults, a posture within the ranges, and loads."""
    rng = np.random.default_rng(seed)
    found = {p.name: float(p.start) * rng.uniform(0.8, 1.2) for p in cls.layout.parameters}
    found |= {name: rng.uniform(*ends) for name, ends in ranges_of(cls, LOADS | POSTURE).items()}
    found |= {
        s.name: s.nominal * rng.normal() for s in cls.layout.states if s.name.endswith("_stretch")
    }
    return found | values


def active(names):
    return {parameter: value for name in names for parameter, value in ACTIVE[name].items()}


def neutral(names):
    return {EFFECTS[name].neutral: 0.0 for name in names}


def at_rest(base, cls):
    """The states that effects add."""
    known = {v.name for v in base.layout.variables}
    return {s.name: 0.0 for s in cls.layout.states if s.name not in known}


def test_catalogue():
    assert fmus.effects("foot_dynamic") == fmus.effects("foot_free") == EFFECTS
    assert fmus.effects("foot_displacement_driven") == EFFECTS
    assert list(fmus.effects("foot")) == [
        "plantar_tendon_across_arch",
        "tension_stiffness",
        "tendon_stretch",
        "tendon_friction",
    ]
    check_described("foot", EFFECTS)
    assert all(effect.declared[effect.neutral].start == 0.0 for effect in EFFECTS.values())


@feet
def test_neutral_is_bit_identical(base):
    """Of every effect alone and of all, with any values of their other parameters; their own states
    at rest.
    """
    own = list(fmus.effects(base.name))
    for names in (*([name] for name in own), own):
        cls = stack(base, *(EFFECTS[name] for name in names))
        for seed in range(50):
            check_neutral(base, cls, drawn(cls, seed) | at_rest(base, cls) | neutral(names))


@feet
def test_neutral_is_bit_identical_in_the_graph(base):
    own = fmus.effects(base.name)
    cls = stack(base, *own.values())
    for seed in range(20):
        values = drawn(cls, seed) | at_rest(base, cls) | neutral(own)
        check_neutral(base, cls, values, in_graph)


@cases
def test_an_active_effect_changes_what_it_should_and_nothing_else(base, name):
    cls, changed = stack(base, EFFECTS[name]), set()
    for seed in range(20):
        values = drawn(cls, seed) | ACTIVE[name]
        at_rest = {s.name: 0.0 for s in EFFECTS[name].layout.states}
        plain, found = named(cls, values | neutral([name]) | at_rest), named(cls, values)
        changed |= {n for n in plain if plain[n] != found[n] and "_stretch" not in n}
    rates = {f"der({joint}_rate)" for joint in MOVED[name]} if base is FootDynamic else set()
    assert changed == CHANGED[name] | rates


@cases
def test_the_slope_at_neutral_is_not_zero(base, name):
    """A score test starts there."""
    cls = stack(base, EFFECTS[name])
    values = drawn(cls, 3) | ACTIVE[name]
    step = 1e-6 * EFFECTS[name].declared[EFFECTS[name].neutral].nominal
    ends = [named(cls, values | {EFFECTS[name].neutral: way * step}) for way in (1.0, -1.0)]
    slopes = {n: (ends[0][n] - ends[1][n]) / (2.0 * step) for n in ends[0]}
    assert all(map(math.isfinite, slopes.values()))
    assert any(abs(slope) > 1e-3 * abs(ends[0][n]) for n, slope in slopes.items())


# --- the equations
# --------------------------------------------------------------------------------------------------


def test_a_tendon_across_the_arch_does_the_work_that_its_length_says():
    """Torque by a tension is less the derivative of a length; the compliance is that of the whole K
    = R^T K_l R.
    """
    cls = stack(Foot, EFFECTS["plantar_tendon_across_arch"])
    stiff, h = {"k_an": 5e3, "k_po": 8e3, "k_do": 3e3, "k_pl": 9e3, "tm_stiffness": 7.0}, 1e-6
    for seed in range(20):
        values = drawn(cls, seed, scale=2.5) | stiff | ACTIVE["plantar_tendon_across_arch"]

        def of(joint, step, outputs, values=values):
            found = named(cls, values | {f"{joint}_angle": values[f"{joint}_angle"] + step})
            return np.array([found[name] for name in outputs])

        def slope(joint, outputs, of=of):
            return (of(joint, h, outputs) - of(joint, -h, outputs)) / (2.0 * h)

        arms = np.column_stack(
            [slope(joint, [f"{a}_length" for a in ACTUATORS]) for joint in JOINTS]
        )
        toe = np.column_stack([slope(joint, ["toe_x", "toe_y"]) for joint in JOINTS])
        tensions = np.array([values[f"{a}_tension"] for a in ACTUATORS])
        forces, now = np.array([values["toe_force_x"], values["toe_force_y"]]), named(cls, values)
        expected = toe.T @ forces - arms.T @ tensions
        assert [now[f"{joint}_torque"] for joint in JOINTS] == pytest.approx(expected, rel=1e-6)
        rates = arms @ [values[f"{joint}_rate"] for joint in JOINTS]
        assert [now[f"{a}_length_rate"] for a in ACTUATORS] == pytest.approx(
            rates, rel=1e-6, abs=1e-9
        )
        k = arms.T @ np.diag([stiff[f"k_{a}"] for a in ACTUATORS]) @ arms + np.diag([0.0, 7.0, 0.0])
        assert abs(k[1, 2]) > 1.0
        whole = toe @ np.linalg.inv(k) @ toe.T
        found = [now[f"toe_compliance_{e}"] for e in ("xx", "xy", "yy")]
        assert found == pytest.approx(whole[np.triu_indices(2)], rel=1e-6)


def test_the_compliance_under_tension_is_how_far_the_toe_moves_in_equilibrium():
    """Springs under tension hold the foot at rest; a force moves it to where the energy of the
    points is least, by Newton's method on their differences.
    """
    cls = stack(Foot, EFFECTS["tension_stiffness"])
    rest, h = np.array(lengths_at(0.0, 0.0)), 1e-4
    arms = (np.array(lengths_at(h, h)) - lengths_at(-h, -h)) / (2 * h)
    pulls = np.array([-5.0 * arms[1] / arms[0], 5.0, -5.0 * arms[3] / arms[2], 5.0])
    signals = {f"{a}_tension": float(pull) for a, pull in zip(ACTUATORS, pulls, strict=True)}
    found = named(cls, signals | {"tension_stiffness_share": 1.0})

    def energy(q, force):
        longer = np.array(lengths_at(q[0], q[2])) - rest
        toe = toe_at(*q)
        stored = pulls @ longer + 0.5 * 9100.0 * longer @ longer + 50.0 * q[1] ** 2
        return stored - force @ [toe.real, toe.imag]

    axes = h * np.eye(3)
    curvature = np.array(
        [
            [
                sum(
                    a * b * energy(a * i + b * j, np.zeros(2)) for a in (1.0, -1.0) for b in (1, -1)
                )
                / (4 * h * h)
                for j in axes
            ]
            for i in axes
        ]
    )
    toe = np.array([(toe_at(*e) - toe_at(*-e)) / (2 * h) for e in axes])
    moved = np.column_stack([toe.real, toe.imag]).T @ np.linalg.inv(curvature)
    whole = moved @ np.column_stack([toe.real, toe.imag])
    compliance = [found[f"toe_compliance_{e}"] for e in ("xx", "xy", "yy")]
    assert compliance == pytest.approx(whole[np.triu_indices(2)], rel=1e-5)
    stiff = named(Foot, signals)["toe_compliance_xx"]
    assert compliance[0] > 1.02 * stiff, "tension softens the foot"


@bases
def test_tendons_stretch_as_voigt_bodies(base):
    """Under a tension that sets in the length falls short by c T (1 - exp(-t / tau)), and its rate
    is that of it.
    """
    c, tau = ACTIVE["tendon_stretch"].values()
    cls = stack(base, EFFECTS["tendon_stretch"])
    held = {} if base is Foot else {f"{joint}_inertia": 1.0 for joint in JOINTS}
    model, plain = cls(**ACTIVE["tendon_stretch"], **held), base(**held)
    integrators = []
    for one in (model, plain):
        one.an_tension, one.po_tension, one.do_tension, one.pl_tension = pull = 1.0, 0.4, 0.7, 0.2
        integrators.append(Integrator(one))
    for k in range(20):
        for integrator in integrators:
            integrator.advance(0.01 * k, 0.01)
        left = math.exp(-0.01 * (k + 1) / tau)
        for actuator, tension in zip(ACTUATORS, pull, strict=True):
            most = c * tension
            for end, expected, size in (
                ("", 1.0 - left, most),
                ("_change", 1.0 - left, most),
                ("_rate", left, most / tau),
            ):
                short = (
                    getattr(plain, f"{actuator}_length{end}")()
                    - getattr(model, f"{actuator}_length{end}")()
                )
                assert short == pytest.approx(expected * size, abs=1e-5 * size)


@bases
def test_a_guide_is_a_capstan_and_takes_energy(base):
    """T exp(w) where the joint draws a tendon out, T exp(-w) where it is drawn along."""
    cls = stack(base, EFFECTS["tendon_friction"])
    w = ACTIVE["tendon_friction"]["tendon_wrap_friction"]
    for rate in (-1.0, -1e-3, 0.0, 1e-3, 1.0):
        values = {"ankle_angle": 0.1, "ankle_rate": rate, "po_tension": 1.5} | ACTIVE[
            "tendon_friction"
        ]
        found = named(cls, values)
        frictionless = named(
            base, {n: v for n, v in values.items() if n not in ACTIVE["tendon_friction"]}
        )
        speed = found["po_length_rate"] / 2e-3
        ratio = found["ankle_torque"] / frictionless["ankle_torque"]
        assert ratio == pytest.approx(math.exp(w * math.tanh(speed)), rel=1e-12)
        assert (found["ankle_torque"] - frictionless["ankle_torque"]) * rate <= 0.0
    assert ratio == pytest.approx(math.exp(w), rel=1e-5)


@pytest.mark.parametrize("joint", JOINTS)
def test_dry_friction_is_newtons_law_with_it(joint):
    """Against points in the plane and their moments, by DOP853; every joint starts moving."""
    name = f"coulomb_friction({joint}_friction)"
    most, width = ACTIVE[name].values()
    k, stand, pulls = JOINTS.index(joint), Stand(), (3.9, 0.3, 2.0)
    start = [*stand.starts.values(), 0.4, 0.3, -0.5]

    def slope(_, x):
        torques = turning(x[:3], *pulls)
        torques[k] -= most * math.tanh(x[3 + k] / width)
        return moving(x, torques, stand.nominal)

    starts = {f"{n}_start": v for n, v in zip(stand.states, start, strict=True)}
    found = []
    for cls, values in ((stack(FootDynamic, EFFECTS[name]), ACTIVE[name]), (FootDynamic, {})):
        model = cls(**stand.settings, **starts, **values)
        model.po_tension, model.pl_tension, model.toe_force_y = pulls
        Integrator(model).advance(0.0, 0.2)
        found.append([getattr(model, n) for n in stand.states])
    exact = solve_ivp(slope, (0.0, 0.2), start, method="DOP853", rtol=1e-10, atol=1e-12).y[:, -1]
    assert found[0] == pytest.approx(exact, abs=1e-7)
    assert abs(found[1][k] - found[0][k]) > 1e-5


@pytest.mark.parametrize("order", [1, -1])
def test_all_effects_together_in_any_order(order):
    """The share of each does not depend on their order."""
    names = list(EFFECTS)
    forth = stack(FootDynamic, *(EFFECTS[n] for n in names))
    other = stack(FootDynamic, *(EFFECTS[n] for n in (names[::order][2:] + names[::order][:2])))
    values = drawn(forth, 5) | active(names)
    assert named(other, values) == pytest.approx(named(forth, values), rel=1e-12)


# --- as FMUs
# --------------------------------------------------------------------------------------------------


@pytest.mark.slow
@feet
def test_builds_agree_on_all_effects(base, tmp_path):
    names = fmus.effects(base.name)
    cls = stack(base, *names.values(), name="everything")
    ranges = ranges_of(cls, LOADS) | (POSTURE if base is Foot else {})
    values = active(names)
    if issubclass(base, FootFree):
        values["leg_height_start"] = 0.044  # ball and toes are in the ground, the heel is not
    still = ("heel_pressure",)
    check_that_builds_agree(cls, values, ranges, tmp_path, (5e-4, 2e-3), still, steps=20)


@pytest.mark.parametrize(
    ("name", "bad", "allowed"),
    [
        ("plantar_tendon_across_arch", {"pl_arch_radius": 0.06}, "[-0.05, 0.05] m"),
        ("tendon_stretch", {"tendon_compliance": -1e-6}, "[0, 1] m/N"),
        ("tendon_stretch", {"tendon_time": 0.0}, "[0.001, 1000] s"),
        ("tendon_friction", {"tendon_wrap_friction": -0.1}, "[0, 10]"),
        ("tendon_friction", {"tendon_friction_velocity": 0.0}, "[1e-06, 1] m/s"),
    ],
)
def test_bad_values_are_refused(tmp_path, name, bad, allowed):
    check_that_bad_values_are_refused(stack(Foot, EFFECTS[name]), bad, allowed, tmp_path)
