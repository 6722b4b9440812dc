"""Linear models of one output: what they can do, as polynomials and in state space."""
