from . import menu as menu
from .discriminating import ENOUGH as ENOUGH
from .discriminating import DiscriminatingExperiment as DiscriminatingExperiment
from .discriminating import ExpectedEvidence as ExpectedEvidence
from .discriminating import Rehearsal as Rehearsal
