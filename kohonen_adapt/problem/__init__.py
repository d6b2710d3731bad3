"""What is asked of a problem, and how its answers are checked."""
