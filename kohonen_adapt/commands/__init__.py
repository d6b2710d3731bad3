"""Subcommands of ``kohonen-adapt``."""
