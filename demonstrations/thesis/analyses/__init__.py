"""Analyses of the thesis whose records are lost, repeated on records of the models."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
