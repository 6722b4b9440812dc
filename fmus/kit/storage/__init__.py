"""Storage behind the scenes: a checked cache, and temporary folders that end with their process."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
