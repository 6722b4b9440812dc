"""The master: it runs systems of co-simulation FMUs, anybody's."""

from orchestration.master.pacing import Pacing, RealTime
from orchestration.master.result import MemberStatistics, Run, Statistics, Stopped
from orchestration.master.run import METHODS, run

__all__ = [
    "METHODS",
    "MemberStatistics",
    "Pacing",
    "RealTime",
    "Run",
    "Statistics",
    "Stopped",
    "run",
]
