"""Compare the package with other methods on problems with exact answers, and check its cost."""
