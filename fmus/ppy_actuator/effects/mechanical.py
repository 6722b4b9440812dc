"""Effects of the springs and dashpots."""

from __future__ import annotations

from typing import Any

from ...kit import Parameter, Size, State, Term, absolute, minimum, sign, sqrt, where
from .base import ActuatorEffect

_SPRING = "spring_elongation over force"


class SecondKelvin(ActuatorEffect):
    """One more Kelvin element in the chain: elongation ``J f``, where ``T df/dt = F - f`` is the
    force of its spring.

    Its transfer function from the load is ``J / (T s + 1)``. Relaxes assumption 9, that creep has
    one time constant (eq. 3.1); ``J = 0`` is the base model.
    """

    id = "second_kelvin"
    title = "A second creep time constant"
    neutral = "second_creep_compliance"
    term = Term("creep", "force", "J / (T s + 1)", "creep remembering force")
    assumption = 9
    sizes = (
        Size("{}", ("second_creep_compliance",)),
        Size("a time constant of {}", ("second_creep_time",)),
    )

    second_creep_compliance = Parameter(
        0.0,
        "m/N",
        min=0,
        max=1e3,
        nominal=1e-5,
        display="mm/N",
        doc="compliance of the second Kelvin element (J)",
    )
    second_creep_time = Parameter(
        20.0,
        "s",
        min=1e-3,
        max=1e9,
        nominal=20.0,
        doc="time constant of the second Kelvin element (T)",
        source="a tenth of b2 / k2",
    )
    second_kelvin_force = State(
        "N", rate="second_kelvin_rate", doc="force of the second Kelvin spring"
    )

    def second_kelvin_rate(self) -> Any:
        """Rate of the force of the second spring, (F - f) / T."""
        return (self.load() - self.second_kelvin_force) / self.second_creep_time

    def creep(self) -> Any:
        """Elongation of all elements but the instantaneous spring, J f more."""
        return super().creep() + self.second_creep_compliance * self.second_kelvin_force


class NonlinearStiffness(ActuatorEffect):
    """Instantaneous spring that softens or stiffens with load: ``x_0 = (F + n (sqrt(F^2 + S^2) -
    S)) / k1``.

    Its compliance goes from ``1/k1`` without load to ``(1 + n)/k1`` under loads much larger than
    ``S``: it softens where ``n > 0`` and stiffens where ``n < 0``. Relaxes assumption 9, that the
    springs are linear (eq. 3.2); ``n = 0`` is the base model.
    """

    id = "nonlinear_stiffness"
    title = "Stiffness that changes with load"
    neutral = "load_softening"
    term = Term("spring_elongation", "force", "n (sqrt(F^2 + S^2) - S)", _SPRING)
    assumption = 9
    sizes = (
        Size(
            "the compliance changes by {} under large load",
            ("load_softening",),
            "%",
            lambda n: 100.0 * n,
        ),
        Size("about a load of {}", ("softening_load",)),
    )

    load_softening = Parameter(
        0.0,
        "1",
        min=-0.95,
        max=0.95,
        nominal=0.1,
        doc="relative change of the compliance k1 has, at large load (n)",
    )
    softening_load = Parameter(
        1.0,
        "N",
        min=1e-6,
        max=1e6,
        doc="load about which the compliance changes (S)",
        source="middle of the loads of section 3.3.1, 0.5 to 2.75 N",
    )

    def spring_elongation(self, load: Any) -> Any:
        """Instantaneous elongation, that of the base model under F + n (sqrt(F^2 + S^2) - S)."""
        scale = self.softening_load
        return super().spring_elongation(
            load + self.load_softening * (sqrt(load * load + scale * scale) - scale)
        )

    def spring_force(self, elongation: Any) -> Any:
        """Inverse of :meth:`spring_elongation`, the root of a quadratic equation."""
        n, scale = self.load_softening, self.softening_load
        shifted = super().spring_force(elongation) + n * scale
        complement = 1.0 - n * n
        return (shifted - n * sqrt(shifted * shifted + complement * (scale * scale))) / complement


class AsymmetricCreep(ActuatorEffect):
    """Kelvin element that recovers slower than it creeps: while it shortens its rate is divided by
    ``1 + r``.

    Relaxes assumption 9, that the dashpots are linear; the thesis itself finds the response not
    completely symmetric (section 3.2.1). ``r = 0`` is the base model. Only a record with
    unloading shows it.
    """

    id = "asymmetric_creep"
    title = "Recovery that is slower than creep"
    neutral = "recovery_slowness"
    term = Term(
        "kelvin_rate", "kelvin_rate", "1 / (1 + r) below 0", "kelvin_rate over its direction"
    )
    assumption = 9
    sizes = (
        Size(
            "recovery takes {} times as long as creep",
            ("recovery_slowness",),
            "1",
            lambda r: 1.0 + r,
        ),
    )

    recovery_slowness = Parameter(
        0.0,
        "1",
        min=-0.9,
        max=1e3,
        nominal=0.1,
        doc="by how much recovery takes longer than creep, relative (r)",
    )

    def kelvin_rate(self) -> Any:
        """Creep rate of the Kelvin element, slower while it shortens."""
        rate = super().kelvin_rate()
        return rate / where(rate < 0.0, 1.0 + self.recovery_slowness, 1.0)


class YieldThreshold(ActuatorEffect):
    """Maxwell dashpot that flows above a yield force only, after Bingham: ``dx_b1/dt = (F - F_y) /
    b1`` beyond ``F_y``.

    Within ``-F_y`` and ``F_y`` it stands still. Relaxes assumption 9, that the dashpots are linear
    (eq. 3.3); ``F_y = 0`` is the base model.
    """

    id = "yield_threshold"
    title = "A yield force of the viscous flow"
    neutral = "yield_force"
    term = Term("flow_force", "force", "F - clip(F, -F_y, F_y)", "flow_force over force")
    assumption = 9
    sizes = (Size("no flow below {}", ("yield_force",)),)

    yield_force = Parameter(
        0.0, "N", min=0, max=1e6, nominal=0.1, doc="load that the dashpot bears without flow (F_y)"
    )

    def flow_force(self) -> Any:
        """Force under which the dashpot flows, the excess over F_y."""
        force = super().flow_force()
        return force - sign(force) * minimum(abs(force), self.yield_force)


class Slack(ActuatorEffect):
    """Catenary: more compliance, by ``m / k1``, below a preload ``P``: ``x_0 = (F + m min(F, P)) /
    k1``.

    Relaxes assumption 3, that the actuator is taut; the thesis preloads it with 0.5 N to remove the
    catenary (section 3.3.1). ``m = 0`` is the base model.
    """

    id = "slack"
    title = "Slack at small load"
    neutral = "slack_compliance"
    term = Term("spring_elongation", "force", "m min(F, P)", _SPRING)
    assumption = 3
    sizes = (
        Size("{} more compliance", ("slack_compliance",), "%", lambda m: 100.0 * m),
        Size("below {}", ("preload",)),
    )

    slack_compliance = Parameter(
        0.0,
        "1",
        min=0,
        max=1e4,
        nominal=0.1,
        doc="additional compliance below the preload, relative to 1/k1 (m)",
    )
    preload = Parameter(
        0.5,
        "N",
        min=0,
        max=1e6,
        doc="load that pulls the catenary straight (P)",
        source="section 3.3.1",
    )

    def spring_elongation(self, load: Any) -> Any:
        """Instantaneous elongation, that of the base model under F + m min(F, P)."""
        return super().spring_elongation(load + self.slack_compliance * minimum(load, self.preload))

    def spring_force(self, elongation: Any) -> Any:
        """Inverse of :meth:`spring_elongation`."""
        force, m = super().spring_force(elongation), self.slack_compliance
        return force - m * minimum(force / (1.0 + m), self.preload)


class SmoothSlack(ActuatorEffect):
    """Compliance that fades with the load: ``x_0 = (F + m F P / (P + |F|)) / k1``, more by ``m /
    k1`` without load.

    The catenary is pulled straight gradually, while `Slack` ends abruptly at its preload. Relaxes
    assumption 3, that the actuator is taut; ``m = 0`` is the base model.
    """

    id = "slack"
    title = "Slack that fades with load"
    neutral = "fading_compliance"
    assumption = 3
    term = Term("spring_elongation", "force", "m F P / (P + |F|)", _SPRING, "smooth")
    sizes = (
        Size("{} more compliance without load", ("fading_compliance",), "%", lambda m: 100.0 * m),
        Size("half of that gone at {}", ("fading_load",)),
    )

    fading_compliance = Parameter(
        0.0,
        "1",
        min=0,
        max=1e4,
        nominal=0.1,
        doc="additional compliance without load, relative to 1/k1 (m)",
    )
    fading_load = Parameter(
        0.5,
        "N",
        min=1e-6,
        max=1e6,
        doc="load at which half of it is left in the elongation (P)",
        source="section 3.3.1",
    )

    def sagging(self, load: Any) -> Any:
        """Load equivalent to the additional elongation, m F P / (P + |F|)."""
        return (
            self.fading_compliance * (load * self.fading_load) / (self.fading_load + absolute(load))
        )

    def spring_elongation(self, load: Any) -> Any:
        """Instantaneous elongation, that of the base model under F + m F P / (P + |F|)."""
        return super().spring_elongation(load + self.sagging(load))

    def spring_force(self, elongation: Any) -> Any:
        """Inverse of :meth:`spring_elongation`, the positive root of a quadratic
        equation in |F|.
        """
        # with e, the force of the base model: |F|^2 + ((1 + m) P - |e|) |F| - |e| P = 0
        force, scale = super().spring_force(elongation), self.fading_load
        half = 0.5 * ((1.0 + self.fading_compliance) * scale - absolute(force))
        root = force * scale / (half + sqrt(half * half + absolute(force) * scale))
        return force - self.sagging(root)  # the root, but exactly e at m = 0
