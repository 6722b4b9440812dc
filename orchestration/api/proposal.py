"""The experiment that a diagnosis proposes, from Python."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from fmus.kit import files
from orchestration.discrepancy.design.experiment import DiscriminatingExperiment
from orchestration.discrepancy.report import wording


@dataclass(frozen=True)
class ProposedExperiment:
    """The experiment that would tell more.

    Attributes
    ----------
    design : DiscriminatingExperiment
        Stimuli by input, duration, step and the evidence to expect.
    component : str
        That it is made on.
    """

    design: DiscriminatingExperiment
    component: str

    def __str__(self) -> str:
        return wording.experiment(self.design)

    def __repr__(self) -> str:
        kinds = ", ".join(
            f"{name}: {stimulus.kind}" for name, stimulus in self.design.stimuli.items()
        )
        return f"<ProposedExperiment {kinds}; {self.design.duration:g} s>"

    def toml(self) -> str:
        """Return it as ``ppy run`` reads it."""
        return self.design.toml(self.component, str(self))

    def to_toml(self, path: str | Path) -> Path:
        """Write it for ``ppy run``.

        Raises
        ------
        UserError
            If it cannot be written.
        """
        files.write(Path(path), self.toml().encode())
        return Path(path)
