"""FMUs of FMI 3.0 as FMUs of FMI 2.0: their description translated, their library wrapped.

Whatever runs, sweeps, fits or composes FMUs then knows one interface.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
