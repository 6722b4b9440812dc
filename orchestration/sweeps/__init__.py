"""Sweeps: one model run over many values of its parameters."""
