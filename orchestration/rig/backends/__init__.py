"""Backends of a rig, one module each, behind one small interface (:mod:`.backend`)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
