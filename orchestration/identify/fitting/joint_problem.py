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
Value = TypeVar("Value")


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
        assumptions.check(names, _joined([record.measured for record in records]))
        self._members = [_member(cls, record, names, fixed, assumptions) for record in records]
        vars(self).update(vars(self._members[0]))
        ties = assumptions.ties
        each = {name for name in names if name in assumptions.each or self.declared[name].starts}
        each |= {name for name, (_, source) in ties.items() if source in each}
        # by record: joint name by that of the model
        self._joint_names = [
            {name: f"{name}@{record.label}" if name in each else name for name in (*names, *ties)}
            for record in records
        ]
        scales = self._by_joint_name(dict(zip(names, self.scales, strict=True)))
        self.scales = [*scales.values()]
        self.names = [*scales]
        self.declared = self.declared | self._by_joint_name(self.declared)
        self.start = self.start | self._by_joint_name(self.start)
        joint_ties = {
            joint[name]: (factor, joint[source])
            for joint in self._joint_names
            for name, (factor, source) in ties.items()
        }
        self.assumptions = replace(
            assumptions,
            bounds=self._by_joint_name(assumptions.bounds),
            priors=self._by_joint_name(assumptions.priors),
            ties=joint_ties,
        )
        self.given = self.assumptions.given
        self.measured = _joined([m.measured for m in self._members])
        self.present = _joined([m.present for m in self._members])
        self.noise_samples = _joined([m.noise_samples for m in self._members])

    def _by_joint_name(self, values: Mapping[str, Value]) -> dict[str, Value]:
        """Return values that are known by the model's names, those that are shared first."""
        by_name = {
            joint: values[name]
            for names in self._joint_names
            for name, joint in names.items()
            if name in values
        }
        return dict(sorted(by_name.items(), key=lambda item: "@" in item[0]))

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
            joint = [joint_names[name] for name in member.names]
            residual, slopes = member.simulate(
                {name: values[one] for name, one in zip(member.names, joint, strict=True)}
            )
            residuals.append(residual)
            columns = np.eye(len(self.names))[[self.names.index(one) for one in joint]]
            sensitivities.append({output: by_own @ columns for output, by_own in slopes.items()})
        return _joined(residuals), _joined(sensitivities)

    def delay_costs(self, values: Mapping[str, float]) -> dict[str, Array]:
        """Return the squared errors (k,) over all records; see `Problem.delay_costs`."""
        costs: dict[str, Array] = {}
        for member, joint in zip(self._members, self._joint_names, strict=True):
            own = {name: values[joint[name]] for name in member.names}
            for name, squares in member.delay_costs(own).items():
                known = costs.get(joint.get(name, name))
                costs[joint.get(name, name)] = squares if known is None else _added(known, squares)
        return costs


def _added(one: Array, other: Array) -> Array:
    """Return the sum of two series (k,), as far as both go."""
    both = min(len(one), len(other))
    return one[:both] + other[:both]


def _member(
    cls: Subject,
    record: FitData,
    names: Sequence[str],
    fixed: Mapping[str, float],
    assumptions: Assumptions,
) -> Problem:
    """Return the problem of one record, in which some outputs may be missing."""
    known = assumptions.noise.items()
    noise = {output: deviation for output, deviation in known if output in record.measured}
    assumptions = replace(assumptions, noise=noise)
    return Problem(cls, *record[:3], names, fixed, assumptions=assumptions)


def _joined(parts: Sequence[Mapping[str, NDArray[Number]]]) -> dict[str, NDArray[Number]]:
    """Return signals of all records, one after the other, by output."""
    outputs = dict.fromkeys(output for part in parts for output in part)
    return {
        output: np.concatenate([part[output] for part in parts if output in part])
        for output in outputs
    }
