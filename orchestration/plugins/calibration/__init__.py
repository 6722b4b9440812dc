"""Calibration of a rig: its file, the conversions of sensors, and the adjustment at two points."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
