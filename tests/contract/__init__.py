"""Claims of the FMU contract: one module for each line, for every component and both builds."""
