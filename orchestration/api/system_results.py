"""Results of ``ppy.diagnose`` of a system: values by member, tables, a picture and a page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from fmus.kit import UserError
from orchestration.api.results import Diagnosed
from orchestration.diagnosis.systems import (
    MemberParameter,
    SystemDiagnosis,
    SystemView,
    overview,
    sentence,
    summary,
    view_of,
)
from orchestration.records import Record
from orchestration.reporting import draw, one_line

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import RenderableType


class SystemResult(Diagnosed):
    """Result of the diagnosis of a system: the members that a record contradicts, and the causes.

    Names are ``member.name``.

    Parameters
    ----------
    diagnosis : SystemDiagnosis
    command : sequence of str
        Words of an equivalent command.

    Attributes
    ----------
    verdict : str
        The gravest of the members': ``wrong``, ``recalibrate``, ``consistent``, or ``cannot be
        judged``.
    sentence : str
        The verdict in words.
    suspects : list of str
        Members whose laws are wrong, the most probable first.
    verdicts : dict of str to str
        Verdict on each member.
    causes, alternatives : list of str
        The first cause of each member that is wrong, and further causes of their groups; empty
        where no cause is sure.
    probabilities : dict of str to float
        Probability of each cause of the groups, or of the best guesses.
    parameters : dict of str to Estimate
        ``value``, ``interval`` (95 %), ``nominal``, ``unit`` by name, in the units of the members.
    changed : list of str
        Parameters that differ significantly from nominal.
    record : Record
    notes : list of str
        Remarks on the data.
    """

    def __init__(self, diagnosis: SystemDiagnosis, command: Sequence[str] = ()):
        figures = summary(diagnosis)
        members = figures["members"]
        super().__init__(command)
        self._diagnosis = diagnosis
        self.verdict = str(diagnosis.verdict)
        self.sentence = sentence(diagnosis)
        self.suspects: list[str] = figures["suspects"]
        self.verdicts: dict[str, str] = {one["member"]: one["verdict"] for one in members}
        self.causes = _named(members, "causes")
        self.alternatives = _named(members, "alternatives")
        self.probabilities: dict[str, float] = {
            f"{one['member']}.{cause['effect']}": cause["probability"]
            for one in members
            for cause in one["group"]
        }
        fitted: dict[str, MemberParameter] = {}
        for one in diagnosis.members:
            fitted |= {f"{one.name}.{name}": found for name, found in one.parameters.items()}
        self.parameters = {n: one.estimate for n, one in fitted.items()}
        self.changed = [name for name, one in fitted.items() if one.differs]
        self.record: Record = diagnosis.record
        self.notes: list[str] = figures["notes"]

    @property
    def details(self) -> SystemDiagnosis:
        """The complete diagnosis, with all fits."""
        return self._diagnosis

    def overview(self) -> list[RenderableType]:
        """Return the renderables that the command prints."""
        return [overview(self._view(self._command))]

    def __repr__(self) -> str:
        named = ", ".join([*self.causes, *self.alternatives]) or ", ".join(self.suspects)
        of = f" {named}" if named else ""
        return one_line(f"SystemResult {self.verdict}{of}: {self._diagnosis.system}")

    def figures(self) -> dict[str, Any]:
        """Return the figures alone, ready for JSON."""
        return summary(self._diagnosis)

    def _view(self, command: str) -> SystemView:
        return view_of(self._diagnosis, command)

    def draw(self) -> Figure:
        """Draw the validation data of the first suspect's output whose error falls most.

        Raises
        ------
        UserError
            If no member can be judged.
        """
        members = [*self._diagnosis.wrong, *self._diagnosis.members]
        judged = (one.judgement.diagnosis for one in members)
        first = next((one for one in judged if one is not None), None)
        if first is None:
            raise UserError("no member can be judged, so there is nothing to draw")
        return draw(first)


def _named(members: Sequence[dict[str, Any]], key: str) -> list[str]:
    """Return names of causes, those of the first suspects first."""
    wrong = sorted(members, key=lambda one: one["verdict"] != "wrong")
    return [f"{one['member']}.{name}" for one in wrong for name in one[key]]
