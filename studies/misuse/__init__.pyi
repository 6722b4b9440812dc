from .kinds import KINDS as KINDS
from .kinds import Columns as Columns
from .records import MisuseCase as MisuseCase
from .records import cases as cases
from .records import draw_misused as draw_misused
from .records import write as write
