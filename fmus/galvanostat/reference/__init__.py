"""Reference results of the galvanostat."""
