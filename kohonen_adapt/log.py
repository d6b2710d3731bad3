"""Log of the package."""

import logging

__all__ = ["logger"]

logger = logging.getLogger("kohonen_adapt")
