"""Building of FMUs: everything that goes into the archive, for every runtime."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
