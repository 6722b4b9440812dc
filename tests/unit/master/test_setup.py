"""Claims: a run that a member or its inputs do not permit is refused before it begins."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit.errors import UserError
from orchestration.master import Stopped, run
from tests.support.master.circle import CIRCLE, TIME
from tests.support.master.failing import ERROR, WARNING, chain, ones
from tests.support.master.failing import TIME as FAILING_TIME
from tests.support.master.samples import ring


def test_disturbances_that_cannot_be_added_are_refused(member):
    system, zeros = ring(member, {"a": {}, "b": {}}, "a.x -> b.u", drive="a.u"), np.zeros(TIME.size)
    for disturbances, options, message in (
        ({"a.u": zeros}, {}, r"disturbance a\.u: is no connected input"),
        ({"b.u": zeros[1:]}, {}, r"disturbance b\.u: shape \(\d+,\) for \d+ communication points"),
        ({"b.u": zeros}, {"extrapolation": 1}, "do not go with extrapolation 1"),
    ):
        with pytest.raises(UserError, match=message):
            run(system, TIME, disturbances=disturbances, **options)


@pytest.mark.parametrize(
    ("abilities", "options", "told"),
    [
        ({"canGetAndSetFMUstate": False}, {"tolerance": 1e-3}, "a: cannot restore its state"),
        (
            {"canHandleVariableCommunicationStepSize": False},
            {"tolerance": 1e-3},
            "a: its steps must all be of one size",
        ),
        (
            {"canHandleVariableCommunicationStepSize": False},
            {"rates": {"a": 0.25}},
            "a: its steps must all be of one",
        ),
        (
            {},
            {"tolerance": 1e-3, "rates": {"a": 0.25}},
            "a: a rate below 1 does not go with a tolerance",
        ),
        (
            {},
            {"rates": {"a": 1.5}},
            "rate 1.5 of a: steps per step of the system must be 1, 2, 3, ... or 1/2, 1/3",
        ),
        ({}, {"rates": {"z": 2}}, "no member named 'z'"),
        ({}, {"method": "newton"}, "method 'newton'; there are: gauss-seidel, jacobi"),
        ({}, {"extrapolation": 2}, "extrapolation 2: 0 "),
        ({}, {"tolerance": -1.0}, "tolerance -1.0: must be a number between 0 and 1"),
        ({}, {"tolerance": "1e-3"}, "tolerance '1e-3': must be a number between 0 and 1"),
        (
            {},
            {"rates": {"a": "2"}},
            "rate '2' of a: steps per step of the system must be 1, 2, 3, ",
        ),
        (
            {},
            {"rates": {"a": None}},
            "rate None of a: steps per step of the system must be 1, 2, 3, ",
        ),
        ({}, {"inputs": {"v": TIME}}, "no input named 'v'"),
        ({}, {"inputs": {"a.u": TIME}}, "input a.u: a.u is fed by b.x already"),
        ({}, {"inputs": {"u": TIME[1:]}}, r"input u: shape \(30,\) for 31 communication points"),
        ({}, {"inputs": {"u": TIME * np.nan}}, "input u: nan at point 0 is no finite number"),
        ({}, {"record": ["a.z"]}, "a: no variable named 'z'"),
        (
            {},
            {"time": np.array([0.0, 1.0, 1.0])},
            "communication points must be at least two finite numbers",
        ),
    ],
)
def test_what_cannot_be_done_is_told_at_once(members, abilities, options, told):
    system = ring(members(**abilities), {"a": {}, "b": {}, "c": {}}, CIRCLE, u="c.u")
    arguments = {"time": TIME} | options
    with pytest.raises(UserError, match=told) as caught:
        run(system, **arguments)
    assert "\n" not in str(caught.value)
    assert not isinstance(caught.value, Stopped)


@pytest.mark.parametrize("options", [{}, {"rates": {"bad": 2}}, {"rates": {"bad": 0.5}}])
def test_warnings_of_the_initialization_are_counted_too(member, options):
    result = run(chain(member, init=WARNING), FAILING_TIME, ones(), **options)
    assert result.notes == ("bad: 1 calls ended with a warning (I do not want to begin)",)


def test_a_member_that_fails_in_initialization(member, scratch):
    with pytest.raises(
        UserError, match=r"^bad: member.fmu: initialization failed: I do not want to begin$"
    ):
        run(chain(member, init=ERROR), FAILING_TIME, ones())
    assert list(scratch.iterdir()) == []


def test_why_it_does_not_begin_matters_more_than_what_follows_from_it(member):
    """Values that are no number during initialization come from parameters that are refused at its
    end.
    """
    system = ring(
        member,
        {"bad": {"nan": 1.0, "when": -1.0, "init": ERROR}, "good": {}},
        "bad.y -> good.u",
        u="bad.u",
    )
    with pytest.raises(
        UserError, match=r"^bad: member\.fmu: initialization failed: I do not want to begin$"
    ):
        run(system, FAILING_TIME, ones())


def test_an_fmu_is_unzipped_once_and_removed(member, scratch):
    seen = []

    def count(done):
        seen.append(sum(path.is_dir() for path in scratch.iterdir()))

    run(chain(member), FAILING_TIME, ones(), progress=count)
    assert set(seen) == {1}
    assert list(scratch.iterdir()) == []
