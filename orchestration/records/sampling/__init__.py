"""Samples of a record: their clock and the holes and limits of channels, repaired or noticed."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
