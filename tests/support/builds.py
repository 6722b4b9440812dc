"""Checks of every effect of a component: both builds held against each other, and values that are
refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from fmus.kit import Component
from fmus.kit.build.building import RUNTIMES, build
from fmus.kit.build.toolchain import host_platform
from orchestration.fmu.instance import Fmu
from orchestration.fmu.simulation import simulate_instance
from tests.contract.checks import refused
from tests.contract.raw import instance


def check_that_builds_agree(
    cls: type[Component],
    values: Mapping[str, float],
    ranges: Mapping[str, tuple[float, float]],
    folder: Path,
    sizes: tuple[float, ...] = (0.001, 0.01, 0.1),
    still: tuple[str, ...] = (),
    steps: int = 60,
) -> None:
    """To 1e-9 over steps of any size, of each output's own size; inputs are drawn from ranges, some
    outputs rest.
    """
    rng = np.random.default_rng(7)
    time = np.concatenate([[0.0], np.cumsum(rng.choice(sizes, steps))])
    inputs = {name: rng.uniform(*ends, time.size) for name, ends in ranges.items()}
    results = {}
    for runtime in RUNTIMES:
        path = folder / f"{runtime}.fmu"
        path.write_bytes(build(cls, runtime, [host_platform()]))
        with Fmu(path, values) as one:
            one.start(0.0, float(time[-1]))
            results[runtime] = simulate_instance(one, time, inputs)
    for output in cls.layout.measurable:
        found, expected = (results[runtime][output.name] for runtime in RUNTIMES)
        assert np.ptp(expected) > 0.0 or output.name in still, output.name
        assert np.abs(found - expected).max() <= 1e-9 * np.abs(expected).max(), output.name


def check_that_bad_values_are_refused(
    cls: type[Component], bad: dict[str, float], allowed: str, folder: Path
) -> None:
    """A value out of range is refused at the end of initialization, by the parameter's name and
    with its range.
    """
    path = folder / "model.fmu"
    path.write_bytes(build(cls, "python", [host_platform()]))
    with instance(path) as one:
        (message,) = refused(one, bad)
    ((parameter, _),) = bad.items()
    assert message.startswith(f"parameter '{parameter}' = ")
    assert message.endswith(f"is outside its range {allowed}")
