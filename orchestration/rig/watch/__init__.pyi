from .ageing import Observer as Observer
from .ageing import ageing_observed as ageing_observed
from .feed import Feed as Feed
from .feed import Listener as Listener
from .serve import PageServer as PageServer
from .tuning import parameters_fed as parameters_fed
