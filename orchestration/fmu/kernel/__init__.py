"""Stepping in C: what is done at every communication point, listed in Python and carried out by ``kernel.c``.

Whatever is rare comes back to Python: failures, progress, Ctrl-C, and what the kernel does not know. Without a C
compiler there is no kernel, and Python carries out the same operations in the same order.
"""
