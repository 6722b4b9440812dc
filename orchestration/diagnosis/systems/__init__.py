"""Diagnosis of systems: members cut at their ports, or closed in their loops, as components."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
