"""Interface of a problem, and validation of the values that a problem returns."""
