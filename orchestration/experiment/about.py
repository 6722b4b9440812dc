"""Attributes of a result that say how it came about."""

from __future__ import annotations

import json
import platform
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Any

import numpy as np

from orchestration.experiment.model import Experiment
from orchestration.master import Pacing


def about_experiment(experiment: Experiment, where: str) -> dict[str, Any]:
    """Return the experiment, and with what it was made; `where` is its file or name."""
    return {
        "title": experiment.title or where,
        "source": experiment.source,
        "duration": experiment.duration,
        "step": experiment.step,
        "seed": experiment.seed,
        "runtime": experiment.runtime,
        "over": experiment.over,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": (
            f"ppy-rig {version('ppy-rig')}, numpy {np.__version__}, Python"
            f" {platform.python_version()}"
        ),
        "experiment": experiment.model_dump_json(exclude_none=True),
    }


def about_pace(pacing: Pacing | None) -> dict[str, Any]:
    """Return how well a run kept pace with real time, if it had to."""
    if pacing is None:
        return {}
    return {
        "deadlines": pacing.deadlines,
        "missed_deadlines": pacing.missed,
        "worst_lag": pacing.worst_lag,
        "worst_lag_at": pacing.worst_at,
        "lateness": json.dumps({"upper_bounds": pacing.edges, "counts": pacing.counts}),
    }
