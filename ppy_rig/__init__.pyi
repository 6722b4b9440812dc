from orchestration import *
from orchestration import __version__ as __version__
