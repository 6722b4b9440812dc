"""Searches for the parameters that predict best, and where they start."""
