"""Constraints on the nodes of boundaries, interfaces, curves and surfaces."""
