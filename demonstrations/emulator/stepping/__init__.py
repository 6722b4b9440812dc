"""Emulated rig that is advanced step by step, as a real one, and not over a whole record."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
