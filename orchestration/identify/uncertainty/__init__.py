"""How well a parameter is known where an ellipse does not tell: profiles of the likelihood."""
