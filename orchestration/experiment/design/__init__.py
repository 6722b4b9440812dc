"""Experiments that are designed: the menu of stimuli, and the one that tells causes apart."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
