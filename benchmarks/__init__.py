"""Benchmark problems with exact answers, and what uniform meshes, refinement and the map make of them."""
