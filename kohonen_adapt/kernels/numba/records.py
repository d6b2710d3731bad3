"""Records of arrays as arguments of compiled loops."""

from typing import Any, TypeVar

from numba import types

from kohonen_adapt.kernels.numba.switch import PLAIN

if not PLAIN:
    from kohonen_adapt.kernels.numba.fast_records import RecordType, register

__all__ = ["record", "record_type"]

Record = TypeVar("Record", bound=type)


def record(record_class: Record) -> Record:
    """Pass a named tuple by address to kernels, which may read the fields.

    Plain numba unpacks the tuple.
    """
    if not PLAIN:
        register(record_class)
    return record_class


def record_type(record_class: Any, fields: tuple[types.Type, ...]) -> types.Type:
    """Return the numba type of a record with fields of the given types."""
    return types.NamedTuple(fields, record_class) if PLAIN else RecordType(record_class, fields)
