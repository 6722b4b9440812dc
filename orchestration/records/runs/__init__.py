"""Several runs: those that one file holds, and those that are measured apart and joined."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
