"""From a record to numbers: parameters, and what the residual says."""
