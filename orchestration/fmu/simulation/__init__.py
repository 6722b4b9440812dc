"""Simulations of an FMU: once, in a process of its own, or many times; limits that outputs pass."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
