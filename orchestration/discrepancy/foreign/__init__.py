"""Diagnosis of FMUs without equations: each is wrapped in corrections that have some."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
