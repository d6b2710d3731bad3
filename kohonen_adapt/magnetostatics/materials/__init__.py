"""Material laws and what they make of a mesh."""
