from .backend import Emulator as Emulator
from .records import draw as draw
from .records import draw_cached as draw_cached
from .records import write as write
