"""Residuals."""
