"""Comparison of a result with a reference: what leaves a tube around each signal, and where."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
