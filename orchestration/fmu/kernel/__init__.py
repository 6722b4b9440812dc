"""The stepping kernel: operations listed in Python and executed by ``kernel.c`` at every point.

It returns to Python for rare events: failures, progress, Ctrl-C, and operations that only Python
can execute. Without a C compiler there is no kernel, and Python executes the same operations in the
same order.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
