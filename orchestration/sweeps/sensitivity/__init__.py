"""What a sweep says of its parameters: Sobol indices, tornado plots, bands of what was drawn at random."""
