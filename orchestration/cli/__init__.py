"""The command ``ppy``."""
