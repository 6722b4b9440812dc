"""Samples of a record: repair of clock and channels, and notices of their flaws."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
