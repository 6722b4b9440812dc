"""Commissioning of a rig: every protection is tried on the real device, and a protocol is kept."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
