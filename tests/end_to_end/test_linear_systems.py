"""Claims: linear models of all systems that ship agree with sine sweeps of their co-simulation.

Within 0.1 dB and 1 degree up to a tenth of the sampling rate: of the bench 30 Hz, of the others
that of their communication step, which is part of the model then. A sweep uses nothing of the
linear model.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from orchestration.linear import point_at, subject_of
from orchestration.system import library
from tests.support.sine_sweep import SineSweep, sine_sweep

BENCH = ("actuator.tension", "bench.position", "bench.force_measured")
FILMS = ("actuator.voltage", "actuator.displacement")
POTENTIOSTAT = ("galvanostat.current", "actuator.displacement")
TENSION = ("actuator.tension",)
FOOT = ("foot.ankle_angle", "foot.toe_x", "foot.toe_y")


class Case(NamedTuple):
    """A sweep: what is driven, how far, and what is read.

    `step` is that of the co-simulation; `held` whether it is part of the linear model.
    """

    system: str
    input: str
    outputs: tuple[str, ...]
    amplitude: float
    frequencies: tuple[float, ...]
    step: float
    held: bool
    at: float = 0.0
    constant: dict[str, float] = {}
    settling: float = 0.0


PULLED = {"force_reference": 1.0}
LOADED = {"mass": 0.1}
STRETCHED = {"length_change": 2.5e-4, "reference": 1.5}
UNTAUGHT = {"learning.learning": 0.0}
CASES = [
    Case("dma_bench", "force_reference", BENCH, 0.1, (0.3, 3.0), 1e-4, False, 2.0, PULLED),
    Case("dma_bench", "current", BENCH, 0.05, (0.3, 3.0), 1e-4, False, 2.0, PULLED),
    Case(
        "degradation_watch",
        "current_command",
        FILMS,
        0.05,
        (0.01, 0.1, 1.0),
        0.1,
        True,
        5.0,
        {"current_command": 0.2},
    ),
    Case("degradation_watch", "force", FILMS[1:], 0.1, (0.01, 0.1, 1.0), 0.1, True, 5.0),
    Case(
        "isotonic_stand", "current_command", FILMS, 0.05, (0.1, 1.0, 10.0), 0.01, True, 5.0, LOADED
    ),
    Case("isotonic_stand", "mass", FILMS[1:], 0.01, (0.1, 1.0, 10.0), 0.01, True, 5.0, LOADED),
    Case("work_loop", "reference", FILMS[1:], 1e-6, (0.05, 0.5, 5.0), 0.01, True, 0.0, UNTAUGHT),
    Case("work_loop", "force", FILMS[1:], 1e-3, (0.02, 0.2), 0.01, True, 0.0, UNTAUGHT),
    Case("displacement_loop", "reference", FILMS[1:], 1e-6, (0.05, 0.5, 5.0), 0.01, True),
    Case("state_feedback_loop", "reference", FILMS[1:], 1e-6, (0.05, 0.5, 5.0), 0.01, True),
    Case("adaptive_loop", "reference", FILMS[1:], 1e-8, (0.05, 0.5, 5.0), 0.01, True),
    Case("tension_loop", "reference", TENSION, 1e-3, (0.5, 5.0), 1e-3, True, 2.0, STRETCHED),
    Case("impedance_bench", "current", BENCH, 0.05, (0.1, 1.0), 1e-4, False, 2.0),
    Case(
        "potentiostat_watch", "voltage_command", POTENTIOSTAT, 0.01, (1.0, 100.0), 1e-3, True, 2.0
    ),
    Case("potentiostat_watch", "force", FILMS[1:], 0.01, (1.0, 100.0), 1e-3, True, 2.0),
    Case("protected_bench", "force_reference", BENCH, 0.1, (0.3, 3.0), 1e-4, False, 2.0, PULLED),
    Case("protected_bench", "current_command", BENCH, 0.05, (0.3, 3.0), 1e-4, False, 2.0, PULLED),
    Case("foot_gait", "po_current", FOOT, 0.05, (10.0, 100.0, 1000.0), 1e-4, True, settling=2.0),
    Case("foot_gait", "toe_force_y", FOOT, 0.01, (10.0, 100.0, 1000.0), 1e-4, True, settling=2.0),
]


COSTLY = ("foot_gait", "isotonic_stand", "protected_bench")
FIRST = list({c.system: c for c in reversed(CASES) if c.system not in COSTLY}.values())


def agree(measured, model):
    ratio = measured / model
    assert np.abs(20.0 * np.log10(np.abs(ratio))).max() < 0.1
    assert np.abs(np.degrees(np.angle(ratio))).max() < 1.0


def test_every_system_with_laws_is_swept():
    # a rig at the end of a cable has laws that nobody knows, and a foot that lands does not stay
    # at an operating point
    with_laws = {name for name in library.NAMES if not name.startswith("hil_")} - {"foot_stance"}
    assert {case.system for case in CASES} == with_laws


@pytest.mark.slow
@pytest.mark.parametrize(
    "case",
    [case if case in FIRST else pytest.param(case, marks=pytest.mark.slow) for case in CASES],
    ids=lambda case: f"{case.system}-{case.input}",
)
def test_sweep_and_linear_model_agree_up_to_a_tenth_of_the_sampling_rate(case):
    system = library.system(case.system)
    subject = subject_of(system)
    point = point_at(subject.graph, case.at, case.constant)
    model = subject.linearise(point, [case.input], case.outputs, case.step if case.held else 0.0)
    frequencies = np.array(case.frequencies)
    assert frequencies[-1] * model.period == pytest.approx(0.1)
    sweep = SineSweep(frequencies, case.amplitude, model.period, case.step, case.at, case.settling)
    measured = sine_sweep(system, case.input, case.outputs, sweep, case.constant, method="jacobi")
    for output in case.outputs:
        agree(measured[output], model.response(frequencies, case.input, output))


@pytest.mark.slow
def test_a_loop_that_is_cut_answers_a_sweep_as_its_transfer_function_says():
    # the foot hangs on an actuator, whose tension answers the length that the foot gives it
    system = library.system("foot_gait")
    subject = subject_of(system)
    step = 1e-4
    point = point_at(subject.graph, 0.0, {})
    loop = subject.loop(point, "foot.po_tension", step)
    tension = subject.linearise(point, ["po_current"], ["po.tension"]).point.outputs["po.tension"]
    frequencies = np.array([10.0, 100.0, 1000.0])
    sweep = SineSweep(frequencies, 0.01, step, step, settling=2.0)
    opened = system.disconnected("foot.po_tension", tension)
    constant = {"foot.po_tension": tension}
    measured = sine_sweep(
        opened, "foot.po_tension", ["po.tension"], sweep, constant, method="jacobi"
    )
    agree(-measured["po.tension"], loop.response(frequencies))


def test_the_bench_cut_at_its_tension_answers_a_sweep_that_is_held_as_long():
    system = library.system("dma_bench")
    subject = subject_of(system)
    point = point_at(subject.graph, 2.0, PULLED)
    loop = subject.loop(point, "bench.tension")
    values = subject.linearise(point, ["current"], ["tension"]).point.outputs
    held = {**PULLED, "bench.tension": values["tension"]}
    frequencies = np.array([1.0, 3.0])
    opened = system.disconnected("bench.tension", values["tension"]).given(
        {f"{name}_start": value for name, value in (point.states | point.discretes).items()}
    )
    # two integrators in a row run away from a sine that begins; the actuator must not go slack
    sweep = SineSweep(frequencies, 1e-6, loop.period, 1e-4, settling=0.5)
    measured = sine_sweep(opened, "bench.tension", ["actuator.tension"], sweep, held)
    agree(-measured["actuator.tension"], loop.response(frequencies))
