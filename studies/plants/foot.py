"""The foot on a stand, from points in the plane as complex numbers.

The real part is down along the leg, the imaginary one forward.

Three links in a row hang from a leg that is fixed. A string pulls the toe forward, by a weight over
a pulley, which keeps it stable; the posterior and the plantar actuator pull against it. A force
acts on a joint by its moment about it, whatever the geometry: there is no Jacobian and no law of
cosines.
"""

from __future__ import annotations

from cmath import exp
from collections.abc import Sequence
from math import radians

from studies.plants.plant import Plant, Range, Signals
from studies.plants.simulation import Values

_LINKS = (50.8e-3, 62.5e-3, 23.6e-3)  # m, table 5-1
_BENDS = tuple(radians(d) for d in (49.0, 30.9, 10.1))
_HEEL = 41.7e-3 * exp(-1j * radians(57.7))  # of po, about the ankle
_CALF = _HEEL - 93.2e-3 * exp(-1j * radians(12.9))  # fixed to the leg
PLANTAR = 16.3e-3  # m, radius on which the plantar tendon lies about the toe's joint
_STOP = 200.0  # rad/s
FINEST_STEP = 2e-3  # s
_LIMITS = ((-0.7, 0.7), (-0.26, 0.26), (-0.15, 1.05))
_DRAWING = (
    "scale l1 l2 l3 l_an l_po l_do l_pl r_an r_po r_do r_pl beta_pf beta_df beta_p beta_an beta_po"
    " gamma_an gamma_po gamma_do ankle_lower ankle_upper tm_lower tm_upper mtp_lower mtp_upper"
)
_OF_OTHER_OUTPUTS = "k_an k_po k_do k_pl b_an b_po b_do b_pl"


def points(angles: Sequence[float]) -> list[complex]:
    """Return ankle, arch, toe joint and toe."""
    at = [0j]
    direction = 0.0
    for link, bend, angle in zip(_LINKS, _BENDS, angles, strict=True):
        direction += bend + angle
        at.append(at[-1] + link * exp(1j * direction))
    return at


def moment(at: complex, force: complex) -> float:
    """Return the moment about the origin of a force at a point.

    Positive from down to forward, which is dorsiflexion.
    """
    return (at.conjugate() * force).imag


def posterior(ankle: float) -> tuple[float, complex, complex]:
    """Return the length of po at the heel, and the direction in which it pulls there."""
    heel = _HEEL * exp(1j * ankle)
    way = _CALF - heel
    return abs(way), heel, way / abs(way)


def turning(angles: Sequence[float], po: float, pl: float, forward: float) -> list[float]:
    """Return torques on the joints by the tensions and by the force on the toe, in N*m."""
    ankle, arch, joint, toe = points(angles)
    _, heel, pull = posterior(angles[0])
    torques = [moment(toe - at, 1j * forward) for at in (ankle, arch, joint)]
    return [torques[0] + moment(heel, po * pull), torques[1], torques[2] - PLANTAR * pl]


def moving(x: Sequence[float], torques: Sequence[float], p: Values) -> list[float]:
    """Return derivatives of angles and rates: driving less resisting torque, over the inertia."""
    angles = x[:3]
    speeds = x[3:6]
    held = 0.0, p["tm_stiffness"] * angles[1], 0.0
    joints = zip(("ankle", "tm", "mtp"), torques, held, angles, speeds, _LIMITS, strict=True)
    return [
        *speeds,
        *(
            (torque - spring - p[f"{name}_damping"] * speed) / p[f"{name}_inertia"]
            - _STOP**2 * beyond(angle, limits)
            for name, torque, spring, angle, speed, limits in joints
        ),
    ]


def beyond(angle: float, limits: tuple[float, float]) -> float:
    """Return how far a joint is in its stop."""
    return angle - min(max(angle, limits[0]), limits[1])


def measured(angles: Sequence[float]) -> list[float]:
    """Return angles, and how much longer po is than in the reference configuration."""
    return [*angles, posterior(angles[0])[0] - abs(_CALF - _HEEL)]


class Foot(Plant):
    """Newton's second law at each joint, whose inertia is constant.

    Outputs are as encoders and an actuator show them.
    """

    model = "foot_dynamic"
    nominal = {
        "ankle_inertia": 1e-3,
        "tm_inertia": 1e-3,
        "mtp_inertia": 2e-5,
        "ankle_damping": 0.02,
        "tm_damping": 0.03,
        "mtp_damping": 1e-3,
        "tm_stiffness": 2.0,
    }
    settings = {"tm_inertia": 1e-3, "tm_damping": 0.03, "tm_stiffness": 2.0}
    known = (*_DRAWING.split(), *_OF_OTHER_OUTPUTS.split(), "stop_frequency")
    own_states = ("ankle_angle", "tm_angle", "mtp_angle", "ankle_rate", "tm_rate", "mtp_rate")
    starts = {"ankle_angle": -0.209, "tm_angle": 0.024, "mtp_angle": 0.081}
    inputs = {
        "po_tension": Range("N", 3.9, 0.6),
        "pl_tension": Range("N", 0.3, 0.15),
        "toe_force_y": Range("N", 2.0, 0.1),
    }
    outputs = {"ankle_angle": "rad", "tm_angle": "rad", "mtp_angle": "rad", "po_length_change": "m"}
    rate = 100.0
    duration = 10.0
    period = 0.3
    timings = ("usual",)
    shown_by = ("ankle_angle", "tm_angle", "mtp_angle", "po_length_change")
    linear = False
    coarsest = FINEST_STEP
    aliases = {
        "ankle_friction": "ankle_friction + ankle_rate",
        "mtp_friction": "mtp_friction + mtp_rate",
        "arch": "arch + tm_angle",
        "arch_radius": "arch_radius + tm_angle",
        "guide": "guide + ankle_rate",
        "stretch": "stretch + po_tension",
    }

    def evaluate(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Balance the torques; in a guide a tendon that is drawn out pulls the more."""
        k = dict(zip(self.inputs, u, strict=True)) | dict(zip(self.own_states, x, strict=False))
        _, heel, pull = posterior(x[0])
        lengthening = -(pull.conjugate() * 1j * x[3] * heel).real
        po = u[0] * (1.0 + self.more("guide", lengthening, x))
        pl = u[1] * (1.0 + self.more("guide", PLANTAR * x[5], x))
        torques = turning(x[:3], po, pl, u[2])
        torques[0] -= self.more("ankle_friction", x[3], x)
        torques[1] -= self.more("arch", x[1], x) + pl * self.more("arch_radius", x[1], x)
        torques[2] -= self.more("mtp_friction", x[5], x)
        rates = moving(x, torques, p)
        k |= {f"_{name}_rate": rate for name, rate in zip(self.own_states, rates, strict=True)}
        k["po_length_change"] = measured(x[:3])[3] - self.more("stretch", u[0], x)
        return k

    def derivatives(self, k: Signals) -> list[float]:
        """Return rates and accelerations of the joints."""
        return [k[f"_{name}_rate"] for name in self.own_states]
