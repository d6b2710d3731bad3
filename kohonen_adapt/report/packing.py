"""Arrays as short text for a page: planes of their bytes, deflated, in base64."""

import base64
import zlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["packed"]

TYPES: dict[str, np.dtype[Any]] = {"f4": np.dtype("<f4"), "u4": np.dtype("<u4"), "u1": np.dtype("u1")}


def packed(values: ArrayLike, kind: str, *, coarse: bool = False) -> dict[str, str]:
    """The record that a page unpacks to a typed array.

    Parameters
    ----------
    values
        Of any shape; they go row by row.
    kind
        ``"f4"``, ``"u4"`` or ``"u1"``: little-endian floats or integers.
    coarse
        Whether floats are rounded to 16 bits (1.5e-5 of each), for what is only looked at.

    Returns
    -------
    dict
        ``type`` and ``data``.

    Notes
    -----
    Bytes of equal weight stand together (the shuffle filter of HDF5): node numbers then shrink to a third, and floats
    by the bits that neighbours share.
    """
    with np.errstate(over="ignore"):  # what float32 does not hold is infinite, and drawn as the end of the scale
        flat = np.ascontiguousarray(values).ravel().astype(TYPES[kind])
    if coarse:
        flat = ((flat.view(np.uint32) + np.uint32(0x80)) & np.uint32(0xFFFFFF00)).view(flat.dtype)
    planes = flat.view(np.uint8).reshape(-1, flat.dtype.itemsize).T
    return {"type": kind, "data": base64.b64encode(zlib.compress(planes.tobytes(), 6)).decode("ascii")}
