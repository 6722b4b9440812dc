"""Known ways the foot is wrong: tendons that stretch, rub and cross the arch, moment arms that
change under tension, and joints with dry friction.

Each is a mixin that overrides laws (never an output) through ``super()``. At its neutral parameter
value the laws equal those of the base model to the last bit. Dry friction belongs to the dynamic
foot; the other effects apply to a given posture as well.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..kit import Effect, Parameter, Size, State, Term, exp, tanh
from ..kit.curves import EffectNames, curve
from ..kit.effects import effects_by_name
from ..kit.generic import describe_effect
from .dynamic import FootDynamic

if TYPE_CHECKING:
    from .statics import FootStatics

    class FootEffect(Effect, FootStatics):
        """Laws of the foot that an effect overrides."""
else:
    FootEffect = Effect

_DRY = 1e-3  # N*m, typical of dry friction in a small joint


def _stretch(actuator: str) -> Any:
    return State(
        "m",
        rate=f"{actuator}_stretch_rate",
        nominal=1e-4,
        display="mm",
        doc=f"stretch of {actuator}'s tendon",
    )


class PlantarTendonAcrossArch(FootEffect):
    """Plantar tendon that crosses the arch as well, on an attachment radius ``a``, and presses it
    down under tension.

    By virtual work the same arm adds ``a theta_TM`` to the length of pl and ``a dtheta_TM/dt`` to
    its rate, subtracts ``a T_pl`` from the torque of the joint, and couples arch and toe in ``K =
    R^T K_l R``. Relaxes assumption 3, that pl acts on the toe only; the program of the thesis
    (appendix A4) has a token 0.001 in that place. ``a = 0`` is the base
    model.
    """

    id = "plantar_tendon_across_arch"
    title = "A plantar tendon that crosses the arch"
    neutral = "pl_arch_radius"
    assumption = 3
    term = Term("joint_torques", "pl_tension", "a T_pl", "joint_torques over pl_tension")
    sizes = (Size("a radius of {}", ("pl_arch_radius",)),)

    pl_arch_radius = Parameter(
        0.0,
        "m",
        min=-0.05,
        max=0.05,
        nominal=1e-2,
        display="mm",
        doc="radius on which the tendon of pl lies about the tarsal-metatarsal joint (a)",
    )

    def pl_arch_arm(self) -> Any:
        """Moment arm of pl about the tarsal-metatarsal joint."""
        return self.scale * self.pl_arch_radius

    def length_changes(self) -> tuple[Any, Any, Any, Any]:
        """Changes of length, that of pl with the motion of the arch."""
        an, po, do, pl = super().length_changes()
        return an, po, do, pl + self.pl_arch_arm() * self.tm_angle

    def length_rates(self) -> tuple[Any, Any, Any, Any]:
        """Rates of length, that of pl with the motion of the arch."""
        an, po, do, pl = super().length_rates()
        return an, po, do, pl + self.pl_arch_arm() * self.tm_rate

    def joint_torques(self) -> tuple[Any, Any, Any]:
        """Torques on the joints, that on the arch with the tension of pl."""
        ankle, tm, mtp = super().joint_torques()
        return ankle, tm - self.pl_arch_arm() * self.tensions()[3], mtp

    def compliance(self, row: int, column: int) -> Any:
        """Entry of ``J K'^-1 J^T``, by the difference from that of the base model, ``J K^-1 J^T``.

        Over arch and toe, ``K = diag(arch, toe)`` and ``K' = K + k a [[a, r], [r, 0]]``, so that
        ``K^-1 - K'^-1 = k a / det(K') [[a (toe - k r^2) / arch, r], [r, -a k r^2 / toe]]``.
        """
        _, tm, mtp = self.jacobian()
        _, arch, toe = self.joint_stiffnesses()
        k = self.k_pl
        a = self.pl_arch_arm()
        r = self.pl_arm()
        toe_without_pl = toe - k * r * r
        off_diagonal = r * (tm[row] * mtp[column] + mtp[row] * tm[column])
        diagonal = a * (
            tm[row] * tm[column] * toe_without_pl / arch - mtp[row] * mtp[column] * k * r * r / toe
        )
        determinant = arch * toe + k * a * a * toe_without_pl
        reduction = k * a * (off_diagonal + diagonal) / determinant
        return super().compliance(row, column) - reduction


class TensionStiffness(FootEffect):
    """Stiffness of a joint by tensions on moment arms that change as it turns: ``s T d2l/dtheta2``
    more.

    Relaxes assumption 5, that the stiffness does not have the change of the moment arms under
    tension; ``s = 0`` is the base model, and at ``s = 1`` the compliance is the derivative of the
    toe's position by the force on it.
    """

    id = "tension_stiffness"
    title = "Moment arms that change under tension"
    neutral = "tension_stiffness_share"
    assumption = 5
    term = Term("joint_stiffnesses", "", "s T d2l/dtheta2", "joint_stiffnesses over tensions")
    sizes = (Size("{} of it", ("tension_stiffness_share",), "%", lambda share: 100.0 * share),)

    tension_stiffness_share = Parameter(
        0.0,
        "1",
        min=0,
        max=1.0,
        nominal=1.0,
        doc="share of the stiffness by tensions on arms that change (s)",
    )

    def joint_stiffnesses(self) -> tuple[Any, Any, Any]:
        """Stiffnesses of the joints, those of ankle and toe with the share of the tensions."""
        ankle, tm, mtp = super().joint_stiffnesses()
        pairs = zip(self.tensions(), self.arm_slopes(), strict=True)
        an, po, do, pl = (tension * slope for tension, slope in pairs)
        share = self.tension_stiffness_share
        return ankle + share * (an + po), tm, mtp + share * (do + pl)


class TendonStretch(FootEffect):
    """Tendons that stretch under tension by ``s``, each as a Voigt body: ``tau ds/dt = c T - s``.

    Each actuator is shorter by the stretch. Stiffness and damping of the toe remain those of the
    actuators. Relaxes assumption 7, that
    tendons do not stretch; ``c = 0`` is the base model. Of viscoelastic tendons: Fung,
    Biomechanics, 2nd ed., 1993, section 2.11.
    """

    id = "tendon_stretch"
    title = "Tendons that stretch"
    neutral = "tendon_compliance"
    assumption = 7
    term = Term(
        "length_changes", "", "-s with tau ds/dt = c T - s", "length_changes remembering tensions"
    )
    sizes = (
        Size("{}", ("tendon_compliance",)),
        Size("a time constant of {}", ("tendon_time",)),
    )

    tendon_compliance = Parameter(
        0.0,
        "m/N",
        min=0,
        max=1.0,
        nominal=1e-4,
        display="mm/N",
        doc="stretch of every tendon per tension (c)",
    )
    tendon_time = Parameter(
        0.05, "s", min=1e-3, max=1e3, nominal=0.05, doc="time in which a tendon stretches (tau)"
    )

    an_stretch, po_stretch, do_stretch, pl_stretch = (
        _stretch(actuator) for actuator in ("an", "po", "do", "pl")
    )

    def an_stretch_rate(self) -> Any:
        """Rate of the stretch of an's tendon."""
        return (self.tendon_compliance * self.an_tension - self.an_stretch) / self.tendon_time

    def po_stretch_rate(self) -> Any:
        """Rate of the stretch of po's tendon."""
        return (self.tendon_compliance * self.po_tension - self.po_stretch) / self.tendon_time

    def do_stretch_rate(self) -> Any:
        """Rate of the stretch of do's tendon."""
        return (self.tendon_compliance * self.do_tension - self.do_stretch) / self.tendon_time

    def pl_stretch_rate(self) -> Any:
        """Rate of the stretch of pl's tendon."""
        return (self.tendon_compliance * self.pl_tension - self.pl_stretch) / self.tendon_time

    def length_changes(self) -> tuple[Any, Any, Any, Any]:
        """Changes of length, each less the stretch of its tendon."""
        an, po, do, pl = super().length_changes()
        return (
            an - self.an_stretch,
            po - self.po_stretch,
            do - self.do_stretch,
            pl - self.pl_stretch,
        )

    def length_rates(self) -> tuple[Any, Any, Any, Any]:
        """Rates of length, the derivatives of :meth:`length_changes`."""
        an, po, do, pl = super().length_rates()
        return (
            an - self.an_stretch_rate(),
            po - self.po_stretch_rate(),
            do - self.do_stretch_rate(),
            pl - self.pl_stretch_rate(),
        )


class TendonFriction(FootEffect):
    """Tendons that rub in their guides: at the joint the tension is ``T exp(w tanh(v / v_w))``, v
    the rate of length.

    The tension at a joint is larger than that of the actuator while the tendon is drawn out, and
    smaller while it is pulled in. ``w`` is the coefficient of friction times the angle of wrap
    (Euler and Eytelwein's capstan equation), the same for all tendons. Relaxes assumption 7, that
    tendons do not rub; ``w = 0`` is the base model.
    """

    id = "tendon_friction"
    title = "Tendons that rub in their guides"
    neutral = "tendon_wrap_friction"
    assumption = 7
    term = Term("tensions", "", "T exp(w tanh(v / v_w))", "tensions over length rates")
    sizes = (
        Size(
            "{} more tension where a tendon is drawn out",
            ("tendon_wrap_friction",),
            "%",
            lambda w: 100.0 * (exp(w) - 1.0),
        ),
    )

    tendon_wrap_friction = Parameter(
        0.0,
        "1",
        min=0,
        max=10.0,
        nominal=0.1,
        doc="coefficient of friction times angle of wrap (w)",
    )
    tendon_friction_velocity = Parameter(
        1e-3,
        "m/s",
        min=1e-6,
        max=1.0,
        nominal=1e-3,
        display="mm/s",
        doc="rate of length within which the friction changes its sign (v_w)",
    )

    def tensions(self) -> tuple[Any, Any, Any, Any]:
        """Tensions at the joints, those of the actuators with friction."""
        pairs = zip(super().tensions(), self.length_rates(), strict=True)
        an, po, do, pl = (
            tension * exp(self.tendon_wrap_friction * tanh(rate / self.tendon_friction_velocity))
            for tension, rate in pairs
        )
        return an, po, do, pl


def _dry_friction(joint: str) -> type[Effect]:
    """Make the effect that adds dry friction, a smooth sign of its rate, to a joint's friction."""
    law = f"{joint}_friction"
    effect = curve(
        FootDynamic,
        law,
        signal=f"{joint}_rate",
        shape="sign",
        unit="N*m",
        nominal=_DRY,
        names=EffectNames(
            id="coulomb_friction",
            variables=(f"{law}_coulomb", f"{law}_coulomb_velocity"),
            qualifier=law,
        ),
    )
    return describe_effect(
        effect,
        8,
        f"""Dry friction of the {joint}: ``M_c tanh(omega / omega_c)`` more, a smooth sign.

    Relaxes assumption 8, that friction in the joints is viscous; ``M_c = 0`` is the base model.
    """,
        f"Dry friction of the {joint} joint",
    )


EFFECTS: dict[str, type[Effect]] = effects_by_name(
    PlantarTendonAcrossArch,
    TensionStiffness,
    TendonStretch,
    TendonFriction,
    *(_dry_friction(joint) for joint in ("ankle", "tm", "mtp")),
)
