"""Diagnosis: the errors of a simulation, their causes, and the gain of an extended model."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
