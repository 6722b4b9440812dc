from .kinds import KINDS as KINDS
from .kinds import Decay as Decay
from .records import DecayCase as DecayCase
from .records import cases as cases
from .records import draw as draw
from .records import write as write
