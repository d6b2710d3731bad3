"""Meshes, files, problems and slow twins that several tests share."""
