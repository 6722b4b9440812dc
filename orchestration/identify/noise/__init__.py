"""Noise of a measured output: its colour, its tails, and how likely it makes a residual."""
