"""Sensitivity analyses of sweeps: Sobol indices, tornado plots and prediction bands."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
