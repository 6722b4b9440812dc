"""Demonstrations of the product: an emulated rig, the demo, and the thesis recomputed."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
