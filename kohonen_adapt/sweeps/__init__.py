"""Compute a function of many cases, on this machine or a cluster, none of them twice."""
