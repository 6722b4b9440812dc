"""Running FMUs in a separate process, so that a crash or a hang of one is reported in one line.

A whole simulation, run or part of a sweep is executed in the process, so that steps need no
communication. Shared memory that outlives the process contains the current call, the progress and
the results.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
