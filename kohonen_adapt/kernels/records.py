"""Pass records of arrays to compiled loops by address.

numba takes a tuple apart wherever it is named: a record of a dozen arrays is some 80 numbers in every call, and half of
what there is to compile. A record that `record` marks goes by its address instead; its arrays are read where they are
used. It is the caller's: kernels read its fields and can neither make a record nor return one.
"""

from typing import Any, TypeVar

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.datamodel import models
from numba.core.typing.templates import AttributeTemplate
from numba.extending import NativeValue, infer_getattr, lower_getattr_generic, register_model, typeof_impl, unbox
from numba.np import numpy_support

__all__ = ["RecordType", "record"]

Record = TypeVar("Record", bound=type)


class RecordType(types.Type):
    """The type of a record: its class and the types of its fields."""

    def __init__(self, made_by: Any, fields: tuple[types.Type, ...]) -> None:
        self.made_by, self.fields = made_by, fields
        super().__init__(name=f"{made_by.__name__}({', '.join(map(str, fields))})")

    def place(self, name: str) -> int:
        """Which field has that name."""
        return self.made_by._fields.index(name)


def record(made_by: Record) -> Record:
    """Let kernels take tuples of this class by their address."""

    @typeof_impl.register(made_by)
    def type_of(value: Any, context: Any) -> RecordType:
        return RecordType(made_by, tuple(typeof_impl(field, context) for field in value))

    return made_by


@register_model(RecordType)
class RecordModel(models.PrimitiveModel):
    """A pointer to the fields one after the other, arrays as numba describes them."""

    def __init__(self, manager: Any, kind: RecordType) -> None:
        fields = [manager.lookup(field).get_value_type() for field in kind.fields]
        super().__init__(manager, kind, ir.LiteralStructType(fields).as_pointer())


@unbox(RecordType)
def address_of(kind: RecordType, given: Any, c: Any) -> NativeValue:
    """Describe the arrays of a record in memory of the call, which borrows them."""
    adapt = cgutils.get_or_insert_function(
        c.builder.module, ir.FunctionType(ir.IntType(32), [c.pyapi.pyobj, c.pyapi.voidptr]), "numba_adapt_ndarray"
    )
    address = cgutils.alloca_once(c.builder, c.context.get_value_type(kind).pointee)
    failed = cgutils.false_bit
    for number, field in enumerate(kind.fields):
        item = c.pyapi.tuple_getitem(given, number)
        place = cgutils.gep_inbounds(c.builder, address, 0, number)
        if isinstance(field, types.Array):
            code = c.builder.call(adapt, (item, c.builder.bitcast(place, c.pyapi.voidptr)))
            failed = c.builder.or_(failed, cgutils.is_not_null(c.builder, code))
        else:
            native = c.unbox(field, item)
            c.builder.store(native.value, place)
            failed = c.builder.or_(failed, native.is_error)
    return NativeValue(address, is_error=failed)


@infer_getattr
class RecordAttributes(AttributeTemplate):
    """Fields have the types that the record's has."""

    key = RecordType

    def generic_resolve(self, kind: RecordType, name: str) -> types.Type | None:
        """The type of a field."""
        return kind.fields[kind.place(name)] if name in kind.made_by._fields else None


@lower_getattr_generic(RecordType)
def field_of(context: Any, builder: Any, kind: RecordType, address: Any, name: str) -> Any:
    """Read a field; no store of a loop changes the record itself, which lets loads leave the loop."""
    number = kind.place(name)
    field, place = kind.fields[number], cgutils.gep_inbounds(builder, address, 0, number)
    if not isinstance(field, types.Array):
        return _constant_load(builder, place)
    array = ir.Constant(place.type.pointee, None)
    members = context.data_model_manager[field]._fields
    for member in ("nitems", "data"):
        k = members.index(member)
        array = builder.insert_value(array, _constant_load(builder, cgutils.gep_inbounds(builder, place, 0, k)), k)
    k, size = members.index("itemsize"), numpy_support.as_dtype(field.dtype).itemsize
    array = builder.insert_value(array, context.get_constant(types.intp, size), k)
    for member in ("shape", "strides"):
        k = members.index(member)
        for axis in range(field.ndim):
            extent = _constant_load(builder, cgutils.gep_inbounds(builder, place, 0, k, axis))
            array = builder.insert_value(array, extent, (k, axis))
    return array


def _constant_load(builder: Any, place: Any) -> Any:
    loaded = builder.load(place)
    loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
    return loaded
