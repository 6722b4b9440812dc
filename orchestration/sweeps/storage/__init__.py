"""Storage of sweeps on disk: journal of a running sweep, and store of its result."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
