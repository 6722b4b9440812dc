"""Graphical methods of the thesis, which read parameters from loops, creep and circuits."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
