from .plants import PLANTS as PLANTS
from .plants import Plant as Plant
from .records import Drawn as Drawn
from .records import NineLawsCase as NineLawsCase
from .records import cases as cases
from .records import draw_law as draw_law
from .records import run as run
