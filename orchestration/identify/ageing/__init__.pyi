from .life import FEWEST as FEWEST
from .life import LifeForecast as LifeForecast
from .life import forecast_life as forecast_life
from .result import Ageing as Ageing
from .result import Course as Course
from .result import Derating as Derating
