from . import compare as compare
from . import options as options
