"""What many runs of a model are made of: one FMU, or a system of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

import numpy as np

from fmus.kit.arrays import Array
from orchestration.fmu.signal import Value


class RepeatedRuns(Protocol):
    """What is opened once, to be run many times; a context manager."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None: ...

    @property
    def inputs(self) -> list[str]:
        """Names of the inputs."""

    def run(
        self,
        time: Array,
        inputs: Mapping[str, Array],
        settings: Mapping[str, Value],
        outputs: Sequence[str],
        longest: float = np.inf,
    ) -> Array:
        """Run once from the start; see `orchestration.fmu.RepeatedFmu.run`."""


class Source(Protocol):
    """Where the runs of a model come from; it can be sent to another process."""

    @property
    def name(self) -> str:
        """What messages call it."""

    @property
    def guid(self) -> str:
        """What tells it from any other source."""

    @property
    def experiment(self) -> tuple[float | None, float | None]:
        """Stop time and step of its default experiment, s."""

    @property
    def nominal(self) -> dict[str, float]:
        """Nominal values that are declared, by variable."""

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that it needs."""

    def with_files(self, files: Sequence[Path]) -> Source:
        """Return it with copies of its files."""

    def points(self, time: Array) -> Array:
        """Return the points (n,) at which something is exchanged, for those that are asked for."""

    def open(self) -> RepeatedRuns:
        """Return what makes the runs; UserError if it cannot be opened."""
