"""Diagnosis of systems: the members that a record of the whole contradicts."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
