"""Systems of FMUs: their model, checks, drawings, and files of SSP."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
