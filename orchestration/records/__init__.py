"""Measured records: from any file of a rig to clean arrays in SI units, with a report of repairs.

Every flaw of a file is either repaired and listed in `Record.repairs`, or the file is refused with
row and reason. Nothing is silently truncated or guessed.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
