"""Reference results of the degradation estimator, and the script that makes them."""
