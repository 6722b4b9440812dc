"""Optimisation of a component's parameters: the best of one objective, or the front of two."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
