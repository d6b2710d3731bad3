"""Define the problems that methods are compared on."""
