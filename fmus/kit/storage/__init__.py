"""Internal storage: a verified cache, and temporary folders that are removed with their process."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
