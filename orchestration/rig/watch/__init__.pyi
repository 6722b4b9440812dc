from .feed import Feed as Feed
from .feed import Listener as Listener
from .history import history as history
from .serve import PageServer as PageServer
