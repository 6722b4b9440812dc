"""Recomputation of the thesis: printed and computed figures, chapter by chapter."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
