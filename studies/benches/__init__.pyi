from .records import BenchRecord as BenchRecord
from .records import draw as draw
from .simulation import NOMINAL as NOMINAL
from .simulation import Bench as Bench
