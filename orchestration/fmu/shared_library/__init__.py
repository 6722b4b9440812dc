"""The shared library of an FMU: opened and closed, its functions, what it logs."""
