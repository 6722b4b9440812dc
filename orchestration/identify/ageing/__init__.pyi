from .life import LifeForecast as LifeForecast
from .life import forecast_life as forecast_life
