"""A record of a motor with more friction than its model has, or with just that; short enough to be
asked in seconds.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from studies.clean.records import KINDS, CleanRecord, conditions, draw
from studies.hidden.curves import Curve, power
from studies.plants.change import static
from studies.plants.library import PLANTS, altered

SAMPLES = 500
FRICTION = power(0.04, 150.0, 2.0)


def motor(
    path: Path, curve: Curve | None, seed: int = 1, specimen: CleanRecord | None = None
) -> CleanRecord:
    """Write a record of a motor whose friction has a curve of its speed more than the model says.

    It is a specimen of its own unless that of another record is given.
    """
    same = (
        {n: v for n, v in specimen.truth.items() if n in specimen.plant.nominal}
        if specimen
        else None
    )
    case = conditions(PLANTS["Motor"], KINDS[0], seed, np.random.default_rng(seed))
    drawn = draw(case, same, altered("Motor", static("friction", curve)) if curve else None)
    part = {"inputs": drawn.inputs, "outputs": drawn.outputs, "clean": drawn.clean}
    cut = {name: {n: v[:SAMPLES] for n, v in of.items()} for name, of in part.items()}
    short = replace(drawn, time=drawn.time[:SAMPLES], **cut)
    short.write(path)
    return short
