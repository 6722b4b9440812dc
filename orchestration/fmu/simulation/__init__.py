"""Simulations of an FMU, once or many times, and remarks on limits that a run exceeds."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
