from .bench import BenchPlant as BenchPlant
from .hidden import hidden_effect as hidden_effect
from .noise import DEVIATIONS as DEVIATIONS
from .noise import Noise as Noise
from .plants import ForceDriven as ForceDriven
from .plants import LengthDriven as LengthDriven
from .plants import Plant as Plant
from .rig import SteppedRig as SteppedRig
