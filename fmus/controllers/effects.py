"""Effects that the models of the controllers omit: computation takes time."""

from __future__ import annotations

from typing import Any

from ..kit import Component, Discrete, Effect, Parameter, Size, Term
from ..kit.effects import effect_maker, effects_by_name, make_effect
from .displacement_controller import DisplacementController
from .impedance_controller import ImpedanceController
from .pid import Pid


@effect_maker
def computational_delay(component: type[Component], law: str, unit: str) -> type[Effect]:
    """Make the effect that delays the command of a controller by a share of a sample.

    Parameters
    ----------
    component : type[Component]
        Controller that has the law.
    law : str
        Name of the law of the command.
    unit : str
        SI unit of the law.

    Returns
    -------
    type[Effect]
        With the parameter ``<law>_lateness`` (l).
    """
    lateness = f"{law}_lateness"
    before = f"{law}_before"

    # the law without delay; `effect` is bound below, before this is first called
    def punctual(self: Any) -> Any:
        return getattr(super(effect, self), law)()

    def late(self: Any) -> Any:
        now = punctual(self)
        return now + getattr(self, lateness) * (getattr(self, before) - now)

    effect = make_effect(
        f"computational_delay_of_{law}".title().replace("_", ""),
        {
            "__doc__": (
                "Command that is late by a share ``l`` of a sample: ``u + l (u_before - u)``.\n\n"
                "    At ``l = 1`` it is the previous command, as if computation took a period; in\n"
                "    between it is the mean of both over the period. Relaxes assumption 1, that\n"
                "    commands are carried out at the sample; ``l = 0`` is the base model.\n"
            ),
            "__module__": __name__,
            lateness: Parameter(
                0.0,
                "1",
                min=0,
                max=1.0,
                nominal=0.1,
                display="%",
                doc="share of a sample by which the command is late (l)",
            ),
            before: Discrete(
                unit,
                update=f"next_{before}",
                period="sample_period",
                doc="command until the latest sample",
            ),
            f"next_{before}": punctual,
            law: late,
        },
        id="computational_delay",
        title="A command that is late",
        neutral=lateness,
        assumption=1,
        term=Term(law, "", "l (u_before - u)", f"{law} with a memory", law),
        sizes=(Size("late by {} of a sample", (lateness,), "%", lambda share: 100.0 * share),),
    )
    return effect


EFFECTS: dict[str, type[Effect]] = effects_by_name(
    computational_delay(Pid, "issued_voltage", "V"),
    computational_delay(DisplacementController, "issued_current", "A"),
    computational_delay(ImpedanceController, "issued_force", "N"),
)
