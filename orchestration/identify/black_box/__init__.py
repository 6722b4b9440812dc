"""Black-box identification: discrete-time models of one output and several inputs, as in Ljung, System Identification."""
