"""What a change may not make worse: speed, memory, spread, drift, results."""
