"""Identification of models from records: parameters, their uncertainty, and noise models."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
