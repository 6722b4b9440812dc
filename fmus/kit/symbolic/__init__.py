"""A component as symbols: its traced laws, and what CasADi makes of them (structure, sensitivities, C source)."""
