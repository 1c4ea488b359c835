"""What the parts of `scripts/bench serve` share. Python's standard library alone."""
