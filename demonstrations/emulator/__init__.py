"""Emulated rig that shares no code with the models: physics and hidden effects."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
