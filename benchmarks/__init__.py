"""Speed of the parts that matter, as ratios measured in one run: ``python -m benchmarks``."""
