"""Analyses of the thesis whose records are lost, made again on records of the models."""
