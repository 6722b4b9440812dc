from . import cache as cache
from . import scratch as scratch
from .cache import cached_file as cached_file
