"""Characterisation of a specimen: which tests its records are, and its parameters by all of them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
