"""Running FMUs in a separate process, so that whatever they do to it is reported in one line.

A whole simulation, run or part of a sweep is executed there, so nothing crosses between processes
at a step. The current call and the progress are kept in shared memory that outlives the process,
together with what was computed.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
