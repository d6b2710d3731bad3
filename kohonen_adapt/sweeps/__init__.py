"""Sweeps of a function over many cases, on this machine or a cluster."""
