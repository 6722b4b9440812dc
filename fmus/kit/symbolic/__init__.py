"""Symbolic components: traced laws with their structure, sensitivities and C source, by CasADi."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
