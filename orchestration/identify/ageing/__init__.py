"""Ageing of an actuator: its circuit in windows of records, its life, and the derating."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
