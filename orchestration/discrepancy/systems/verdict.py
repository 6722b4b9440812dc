"""What is said of the members of a system, and why: consistent, recalibrate, wrong or cannot be judged."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.residuals.correlation import CrossCorrelation
from orchestration.discrepancy.residuals.operating_regions import OperatingRegion
from orchestration.discrepancy.residuals.random_walk import RandomWalkTest
from orchestration.discrepancy.residuals.regression import ResidualRegression
from orchestration.discrepancy.systems.adjust import AdjustmentResult
from orchestration.identify.metrics import Whiteness, number
from orchestration.records import Record

Array = NDArray[np.float64]
_LOST = 0.5  # of the variation of an output: if that much is in doubt, nothing can be said of it
_MATTERS = 0.5  # noise widths that a fault must leave
_HARDLY, _ROUGHLY = 0.5, 2.0  # by which doubt, which is no more than an estimate, must be exceeded: to look, to blame
_UNMOVED = 1.5  # noise widths below which an output has not moved


@dataclass(frozen=True)
class OutputAssessment:
    """One output of one member, simulated and measured.

    Attributes
    ----------
    measured, simulated : ndarray, shape (n,)
        In the FMU's unit.
    unit : str
    fit_percent, rms : float
    noise : float
        Of the measurement, as the record itself tells: standard deviation of what changes from sample to sample.
    doubt : float
        What noise of the inputs, and their course between samples, can do to the output: rms.
    whiteness : Whiteness or None
        None if there are too few samples to test.
    explained : ResidualRegression
        Of the residual, by the member's inputs and outputs.
    slow : RandomWalkTest
    associations : list of CrossCorrelation
    regions : list of OperatingRegion
    """

    measured: Array
    simulated: Array
    unit: str
    fit_percent: float
    rms: float
    noise: float
    doubt: float
    whiteness: Whiteness | None
    explained: ResidualRegression
    slow: RandomWalkTest
    cross_correlations: list[CrossCorrelation]
    regions: list[OperatingRegion]

    @property
    def lost(self) -> bool:
        """Whether the simulation runs away from whatever was measured, so that it says nothing."""
        return self.doubt > _LOST * float(np.nanstd(self.measured))

    @property
    def suspect(self) -> bool:
        """Whether so much is explained or wanders that the parameters should be looked at."""
        return self._more_than(_HARDLY)

    @property
    def wrong(self) -> bool:
        """Whether more is explained or wanders than noise and doubt can account for."""
        return self._more_than(_ROUGHLY)

    def _more_than(self, doubts: float) -> bool:
        matters = np.hypot(_MATTERS * self.noise, doubts * self.doubt)
        found = any(f.significant and f.rms > matters for f in (self.explained, self.slow))
        # a residual that is large and no mere noise, though no regression follows it
        structured = any(a.significant for a in self.associations) or any(r.significant for r in self.regions)
        large = self.rms > (1.0 + doubts / _ROUGHLY) * np.hypot(self.noise, self.doubt)
        return not self.lost and bool(found or (structured and large))


@dataclass(frozen=True)
class AdjustedParameter:
    """A parameter that was adjusted, in the FMU's unit.

    Attributes
    ----------
    value, nominal : float
    unit : str
    differs : bool
        Surely, and by more than is worth a word.
    """

    value: float
    nominal: float
    unit: str
    differs: bool


@dataclass(frozen=True)
class MemberDiagnosis:
    """What is said of one member.

    Attributes
    ----------
    name, fmu, model : str
        In the system, the file, and the name that the FMU gives its model: for one of ours that of the component.
    verdict : {"consistent", "recalibrate", "wrong", "cannot be judged"}
    why : str
        In words.
    fed : dict of str to str
        Where each input is from, and whether it is held or changes linearly between samples.
    before, after : dict of str to OutputAssessment
        By output; ``after`` with the adjusted parameters, empty if none were.
    parameters : dict of str to AdjustedParameter
    simulations : int
    signals : dict of str to str
        Measured inputs and outputs of the FMU, and what each is called in the system.
    """

    name: str
    fmu: str
    model: str
    verdict: str
    why: str
    fed: dict[str, str] = field(default_factory=dict)
    before: dict[str, OutputAssessment] = field(default_factory=dict)
    after: dict[str, OutputAssessment] = field(default_factory=dict)
    parameters: dict[str, AdjustedParameter] = field(default_factory=dict)
    simulations: int = 0
    signals: dict[str, str] = field(default_factory=dict)

    @property
    def ours(self) -> bool:
        """Whether the model is a component of this project by its name, so that its equations are known."""
        from fmus import COMPONENTS

        return self.model in COMPONENTS

    @property
    def final(self) -> dict[str, OutputAssessment]:
        """The last judgement of every output."""
        return self.after or self.before


@dataclass(frozen=True)
class SystemDiagnosis:
    """Which members are wrong.

    Attributes
    ----------
    system : str
    record : Record
    members : list of MemberDiagnosis
    """

    system: str
    record: Record
    members: list[MemberDiagnosis]

    @property
    def wrong(self) -> list[str]:
        """Members whose structure is wrong."""
        return [m.name for m in self.members if m.verdict == "wrong"]

    @property
    def verdict(self) -> str:
        """The gravest of all: wrong, recalibrate, consistent; cannot be judged if no member could be."""
        return min(
            (m.verdict for m in self.members), key=("wrong", "recalibrate", "consistent", "cannot be judged").index
        )

    def as_json(self) -> dict[str, Any]:
        """Figures, ready for JSON."""
        return {"system": self.system, "verdict": self.verdict, "members": [_member_json(m) for m in self.members]}


def _member_json(m: MemberDiagnosis) -> dict[str, Any]:
    return {
        "member": m.name, "fmu": m.fmu, "model": m.model, "ours": m.ours,
        "verdict": m.verdict, "why": m.why, "fed": m.fed,
        "outputs": {o: _output_json(m, o) for o in m.final},
        "parameters": {n: asdict(c) for n, c in m.parameters.items()},
        "simulations": m.simulations,
    }  # fmt: skip


def _output_json(m: MemberDiagnosis, output: str) -> dict[str, Any]:
    before, after = m.before[output], m.final[output]
    return {
        "fit_percent_before": number(before.fit_percent), "fit_percent": number(after.fit_percent),
        "rms": number(after.rms), "unit": after.unit, "noise": after.noise, "doubt": after.doubt,
        "white": after.whiteness.is_white if after.whiteness else None,
        "explained": {"rms": after.explained.rms, "p_value": after.explained.p_value},
        "slow": {"rms": after.slow.rms, "p_value": after.slow.p_value},
        "associations": [a.text for a in after.associations if a.significant][:5],
        "regions": [r.text for r in after.regions if r.significant][:5],
    }  # fmt: skip


def verdict_of(
    before: Mapping[str, OutputAssessment], after: Mapping[str, OutputAssessment] | None, changed: Mapping[str, AdjustedParameter],
    adjusted: AdjustmentResult | None,
) -> tuple[str, str]:  # fmt: skip
    """Tell the verdict and why.

    Parameters
    ----------
    before, after : Mapping of str to OutputAssessment
        By output; ``after`` with the adjusted parameters, None if none were.
    changed : Mapping of str to AdjustedParameter
    adjusted : AdjustmentResult, optional

    Returns
    -------
    verdict, why : str
    """
    final = after or before
    lost = [o for o, j in final.items() if j.lost]
    aside = f"; {', '.join(lost)} says nothing: what its inputs do between samples, or their noise, moves it too far"
    aside = aside if lost else ""
    if len(lost) == len(final):
        return "cannot be judged", aside.removeprefix("; ")
    wrong = [o for o, j in final.items() if j.wrong]
    if wrong:
        worst = max(wrong, key=lambda o: final[o].rms / max(final[o].noise, 1e-300))
        j = final[worst]
        cause = next((a.text for a in j.associations if a.significant), "") or next(
            (r.text for r in j.regions if r.significant), ""
        )
        left = f"{worst} is off by {j.rms:.3g} {j.unit} rms, {j.rms / max(j.noise, 1e-300):.1f} noise widths"
        tried = ", whatever its parameters" if adjusted and adjusted.values else ""
        short = " (the search for parameters was cut short)" if adjusted and not adjusted.whole else ""
        return "wrong", f"{left}{tried}{short}" + (f"; {cause}" if cause else "") + aside
    significantly_changed = [n for n, c in changed.items() if c.differs]
    if significantly_changed:
        pairs = [(n, changed[n]) for n in significantly_changed]
        told = ", ".join(f"{n} is {c.value:.4g} {c.unit} instead of {c.nominal:.4g}" for n, c in pairs)
        return "recalibrate", told + aside
    still = [o for o, j in final.items() if np.nanstd(j.measured) < _UNMOVED * j.noise]
    aside += f"; {', '.join(still)} does not move in this record, which says little of it" if still else ""
    return "consistent", "nothing is left that noise cannot account for" + aside
