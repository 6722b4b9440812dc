"""Reference results of the voice-coil dynamic mechanical analyzer, and what computes them."""
