"""The adaptive loop: solve, estimate, relocate, polish, stop."""
