from .common import CATEGORIES as CATEGORIES
from .common import Capabilities as Capabilities
from .fmi2 import describe_fmi2 as describe_fmi2
from .fmi3 import build_description as build_description
from .fmi3 import describe_fmi3 as describe_fmi3
from .terminals import terminals as terminals
