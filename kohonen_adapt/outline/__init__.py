"""Where nodes may go: outlines, curves on them, periodic pairs and layers."""
