"""Adaptive loop, with its result, history and checkpoints."""
