"""Measured records: any file of a rig becomes clean arrays in SI units, every repair reported.

Every flaw of a file is either repaired, and then stands as one line in `Record.repairs`, or refused
with file, row and reason. Nothing is silently truncated or guessed.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
