from .compiled import CompiledModel as CompiledModel
from .compiled import Trajectory as Trajectory
from .compiled import plain_library as plain_library
from .library import RecordLibrary as RecordLibrary
from .ticks import Rhythm as Rhythm
from .ticks import Ticks as Ticks
from .ticks import ticks_of as ticks_of
