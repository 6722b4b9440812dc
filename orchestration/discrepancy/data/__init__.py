"""Data of a diagnosis: records as datasets, screened, and divided to fit and to judge."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
