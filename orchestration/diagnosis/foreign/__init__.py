"""Diagnosis of FMUs without equations: by corrections of what each gives, and of what it gets."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
