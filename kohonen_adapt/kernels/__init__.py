"""Every compiled loop of the package: plain arrays in, arrays filled; no checks, no meshes, no files."""
