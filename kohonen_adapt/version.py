"""Version of the package, which the build, reports and the command line read."""

__all__ = ["__version__"]

__version__ = "1.0.0"
