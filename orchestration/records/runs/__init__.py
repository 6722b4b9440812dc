"""Several runs: division of a file into runs, and runs joined into one record."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
