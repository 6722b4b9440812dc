"""Protocols of models for many runs, which are single FMUs and systems of FMUs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Protocol

import numpy as np

from fmus.kit.arrays import Array
from orchestration.fmu.signal import Value


class RepeatedRuns(AbstractContextManager["RepeatedRuns"], Protocol):
    """A model that is opened once and run many times; a context manager."""

    @property
    def inputs(self) -> list[str]:
        """Names of the inputs."""

    @property
    def remarks(self) -> set[str]:
        """Remarks for users on runs that did not fail."""

    def run(
        self,
        time: Array,
        inputs: Mapping[str, Array],
        settings: Mapping[str, Value],
        outputs: Sequence[str],
        longest: float = np.inf,
    ) -> Array:
        """Simulate once; see `orchestration.fmu.simulation.RepeatedFmu.run`."""


class Source(Protocol):
    """A model to be run many times; it can be sent to another process."""

    @property
    def name(self) -> str:
        """Name in messages."""

    @property
    def guid(self) -> str:
        """GUID of an FMU, or digest of a system."""

    @property
    def default_experiment(self) -> tuple[float, float | None, float | None]:
        """Declared start time, stop time and step in s; None for one that is not declared."""

    @property
    def nominal(self) -> dict[str, float]:
        """Declared nominal values by variable."""

    @property
    def files(self) -> tuple[Path, ...]:
        """Files of the model."""

    def with_files(self, files: Sequence[Path]) -> Source:
        """Return the same source with other paths of its files, in the order of `files`."""

    def points(self, time: Array) -> Array:
        """Return the communication points (n,) of runs with outputs at `time` (n,), s."""

    def open(self) -> RepeatedRuns:
        """Return the opened model; UserError if it cannot be opened."""
