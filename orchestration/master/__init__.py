"""The master: it runs systems of co-simulation FMUs, anybody's."""

from orchestration.master.result import Run, Spent, Statistics, Stopped
from orchestration.master.run import METHODS, run

__all__ = ["METHODS", "Run", "Spent", "Statistics", "Stopped", "run"]
