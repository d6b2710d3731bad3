"""A scikit-fem mesh as arrays that kernels change, and back with every name."""
