"""The stepping kernel: operations listed in Python and carried out by ``kernel.c`` at every point.

Python takes over for what is rare: failures, progress, Ctrl-C, and what the kernel does not know.
Without a C compiler there is no kernel, and Python carries out the same operations in the same
order.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
