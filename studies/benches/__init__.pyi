from .records import KNOWN as KNOWN
from .records import STAND_EFFECTS as STAND_EFFECTS
from .records import SystemRecord as SystemRecord
from .records import draw_bench as draw_bench
from .records import draw_stand as draw_stand
from .simulation import NOMINAL as NOMINAL
from .simulation import Bench as Bench
from .stand import Stand as Stand
