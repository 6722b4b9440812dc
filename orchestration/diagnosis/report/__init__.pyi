from . import curves as curves
from . import summary as summary
from . import terminal as terminal
from . import wording as wording
from .effect_file import effect_source as effect_source
from .explanation import Explanation as Explanation
from .explanation import explain as explain
