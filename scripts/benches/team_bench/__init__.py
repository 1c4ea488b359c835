"""What the parts of `scripts/bench teams` share. Python's standard library alone."""
