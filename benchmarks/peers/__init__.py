"""Compare the package with other methods and programs."""
