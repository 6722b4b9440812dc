"""Hardware in the loop: the server of a rig, its backends and limits, its live page and records."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
