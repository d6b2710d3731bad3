"""Check what a change may not make worse: speed, memory, spread, drift, results, size."""
