"""Several records as one output-error problem: shared parameters, and those of each record.

A parameter of one record is named ``NAME@RECORD``. Noise is that of an output in all records.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from fmus.kit.arrays import Array, Signals
from orchestration.identify.fitting.assumptions import NO_ASSUMPTIONS, Assumptions
from orchestration.identify.fitting.problem import Problem, Subject

Number = TypeVar("Number", bound=np.generic)


class FitData(NamedTuple):
    """One record that a model is fitted to.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Seconds.
    inputs, measured : Mapping[str, ndarray], shape (n,)
        Inputs and measured outputs, SI; NaN in an output is a gap.
    label : str
        Name of the record, different for each.
    """

    time: Array
    inputs: Signals
    measured: Signals
    label: str = ""


class JointProblem(Problem):
    """A model and several records with shared parameters.

    Parameters
    ----------
    cls : type[Component] or FmuWithDifferences
    records : sequence of FitData
    names : sequence of str
        Parameters to search. Start values of states, and those that `Assumptions.each` names, are
        searched for each record by itself.
    fixed : Mapping[str, float]
        See `Problem`.
    assumptions : Assumptions
    """

    def __init__(
        self,
        cls: Subject,
        records: Sequence[FitData],
        names: Sequence[str],
        fixed: Mapping[str, float],
        assumptions: Assumptions = NO_ASSUMPTIONS,
    ):
        self._members = [
            Problem(
                cls,
                record.time,
                record.inputs,
                record.measured,
                names,
                fixed,
                assumptions=_without_unmeasured(assumptions, record.measured),
            )
            for record in records
        ]
        first = self._members[0]
        each = [name for name in names if name in assumptions.each or first.declared[name].starts]
        labels = [record.label for record in records]
        self.names = [name for name in names if name not in each]
        self._joint_names: list[dict[str, str]] = []  # by record: joint name by the model's
        for label in labels:
            own = {name: f"{name}@{label}" for name in each}
            self.names += own.values()
            self._joint_names.append({name: own.get(name, name) for name in names})
        self.assumptions = assumptions
        self.model = first.model
        self._step = first._step
        self._adopt(first)
        self.measured = _joined([m.measured for m in self._members])
        self.present = _joined([m.present for m in self._members])
        self.noise_samples = _joined([m.noise_samples for m in self._members])
        self.evaluations = 0
        self.held = []
        self._at = None

    def _adopt(self, member: Problem) -> None:
        """Take over declarations, starts, scales and priors of a member, by the joint names."""
        self.declared = dict(member.declared)
        self.start = dict(member.start)
        by_name = dict(zip(member.names, member.scales, strict=True))
        priors = {}
        for names in self._joint_names:
            for name, joint in names.items():
                self.declared[joint] = member.declared[name]
                self.start[joint] = member.start[name]
                by_name[joint] = by_name[name]
                if name in self.assumptions.priors:
                    priors[joint] = self.assumptions.priors[name]
        self.scales = [by_name[name] for name in self.names]
        self.assumptions = replace(self.assumptions, priors=priors)
        self.given = self.assumptions.given

    def simulate(self, values: Mapping[str, float]) -> tuple[dict[str, Array], dict[str, Array]]:
        """Return residuals (m,) of all records, and derivatives (m, p) of the simulations.

        Raises
        ------
        UserError
            If a simulation fails there.
        """
        residuals = []
        sensitivities = []
        for member, joint_names in zip(self._members, self._joint_names, strict=True):
            residual, by_value = member.simulate(
                {name: values[joint] for name, joint in joint_names.items()}
            )
            columns = [self.names.index(joint) for joint in joint_names.values()]
            residuals.append(residual)
            sensitivities.append(
                {output: self._widened(slopes, columns) for output, slopes in by_value.items()}
            )
        return _joined(residuals), _joined(sensitivities)

    def _widened(self, slopes: Array, columns: Sequence[int]) -> Array:
        """Return derivatives (m, p) by all joint parameters from those (m, k) by some."""
        wide = np.zeros((len(slopes), len(self.names)))
        wide[:, columns] = slopes
        return wide


def _joined(parts: Sequence[Mapping[str, NDArray[Number]]]) -> dict[str, NDArray[Number]]:
    """Return signals of all records, one after the other, by output."""
    outputs = dict.fromkeys(output for part in parts for output in part)
    return {
        output: np.concatenate([part[output] for part in parts if output in part])
        for output in outputs
    }


def _without_unmeasured(assumptions: Assumptions, measured: Signals) -> Assumptions:
    """Return assumptions for a record in which some outputs may be missing."""
    noise = {output: d for output, d in assumptions.noise.items() if output in measured}
    return replace(assumptions, noise=noise)
