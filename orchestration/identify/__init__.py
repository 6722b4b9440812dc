"""From a record to parameters, with their uncertainty and the noise of the outputs."""
