"""Records of arrays as arguments of compiled loops, passed by address.

numba unpacks a tuple at every call: a record of a dozen arrays is some 80 numbers, and half of the code to compile. A
class with the decorator `record` is passed by address instead. Kernels read the fields, but can neither create nor
return a record.
"""

from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.datamodel import models
from numba.core.typing.templates import AttributeTemplate
from numba.extending import NativeValue, infer_getattr, lower_getattr_generic, register_model, typeof_impl, unbox
from numba.np import numpy_support

__all__ = ["RecordType", "register"]


class RecordType(types.Type):
    def __init__(self, record_class: Any, fields: tuple[types.Type, ...]) -> None:
        self.record_class, self.fields = record_class, fields
        super().__init__(name=f"{record_class.__name__}({', '.join(map(str, fields))})")

    def index(self, name: str) -> int:
        return self.record_class._fields.index(name)


def register(record_class: Any) -> None:
    @typeof_impl.register(record_class)
    def type_of(value: Any, context: Any) -> RecordType:
        return RecordType(record_class, tuple(typeof_impl(field, context) for field in value))


@register_model(RecordType)
class RecordModel(models.PrimitiveModel):
    """Data model of a record as a pointer to the fields, with arrays as in numba."""

    def __init__(self, manager: Any, kind: RecordType) -> None:
        fields = [manager.lookup(field).get_value_type() for field in kind.fields]
        super().__init__(manager, kind, ir.LiteralStructType(fields).as_pointer())


@unbox(RecordType)
def address_of(kind: RecordType, obj: Any, c: Any) -> NativeValue:
    adapt = cgutils.get_or_insert_function(
        c.builder.module, ir.FunctionType(ir.IntType(32), [c.pyapi.pyobj, c.pyapi.voidptr]), "numba_adapt_ndarray"
    )
    address = cgutils.alloca_once(c.builder, c.context.get_value_type(kind).pointee)
    failed = cgutils.false_bit
    for k, field in enumerate(kind.fields):
        item = c.pyapi.tuple_getitem(obj, k)
        field_address = cgutils.gep_inbounds(c.builder, address, 0, k)
        if isinstance(field, types.Array):
            code = c.builder.call(adapt, (item, c.builder.bitcast(field_address, c.pyapi.voidptr)))
            failed = c.builder.or_(failed, cgutils.is_not_null(c.builder, code))
        else:
            native = c.unbox(field, item)
            c.builder.store(native.value, field_address)
            failed = c.builder.or_(failed, native.is_error)
    return NativeValue(address, is_error=failed)


@infer_getattr
class RecordAttributes(AttributeTemplate):
    key = RecordType

    def generic_resolve(self, kind: RecordType, name: str) -> types.Type | None:
        return kind.fields[kind.index(name)] if name in kind.record_class._fields else None


@lower_getattr_generic(RecordType)
def field_of(context: Any, builder: Any, kind: RecordType, address: Any, name: str) -> Any:
    """Return a field of a record.

    Loads are marked as invariant because no loop changes a record, so that LLVM moves them out of loops.
    """
    index = kind.index(name)
    field = kind.fields[index]
    field_address = cgutils.gep_inbounds(builder, address, 0, index)
    if not isinstance(field, types.Array):
        return _constant_load(builder, field_address)
    array = ir.Constant(field_address.type.pointee, None)
    members = context.data_model_manager[field]._fields
    for member in ("nitems", "data"):
        k = members.index(member)
        array = builder.insert_value(
            array, _constant_load(builder, cgutils.gep_inbounds(builder, field_address, 0, k)), k
        )
    k = members.index("itemsize")
    size = numpy_support.as_dtype(field.dtype).itemsize
    array = builder.insert_value(array, context.get_constant(types.intp, size), k)
    for member in ("shape", "strides"):
        k = members.index(member)
        for axis in range(field.ndim):
            extent = _constant_load(builder, cgutils.gep_inbounds(builder, field_address, 0, k, axis))
            array = builder.insert_value(array, extent, (k, axis))
    return array


def _constant_load(builder: Any, address: Any) -> Any:
    loaded = builder.load(address)
    loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
    return loaded
