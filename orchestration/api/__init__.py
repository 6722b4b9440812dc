"""Functions for users in Python, which `orchestration` and `ppy_rig` offer."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
