"""Fits of a model's parameters to a record: the problem, the optimiser, and the ways to fit."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
