"""What compiled code reads: all tables behind two pointers, and rows and grids of numbers as bare pointers.

To numba an array is seven numbers, and the tables are eighteen arrays: handed by value from function to function, these
made most of what there was to compile. Here a table's place is looked up where it is used, in the header that
`tables.packed` writes.

Pointers hold no reference, check no bound, and know no negative index: the arrays behind them must be contiguous and be
arguments of the function that uses them.
"""

from __future__ import annotations

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate, signature
from numba.extending import (
    infer_getattr,
    intrinsic,
    lower_builtin,
    lower_getattr_generic,
    models,
    register_model,
    type_callable,
)

from ..tables import INTEGERS, WIDTHS, Tables

# What it makes has other arguments than what it is made of.
_intrinsic: Any = intrinsic

_NUMBERS = {name: i for i, name in enumerate(Tables._fields)}


class Row(types.Type):
    """The type of a pointer to numbers."""

    def __init__(self, dtype: Any) -> None:
        self.dtype = dtype
        super().__init__(name=f"Row({dtype})")


class Grid(types.Type):
    """The type of a pointer to rows of a width that is known when code is compiled, with their number.

    What is constant is read once, however often it is asked for.
    """

    def __init__(self, dtype: Any, width: int, constant: bool = False) -> None:
        self.dtype, self.width, self.constant = dtype, width, constant
        super().__init__(name=f"Grid({dtype}, {width}, {constant})")


class _TablesType(types.Type):
    """The type of what has the attributes of `Tables`, each a constant grid."""

    def __init__(self) -> None:
        super().__init__(name="Tables")


@register_model(Row)
class _RowModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, of: Any) -> None:
        super().__init__(dmm, of, dmm.lookup(of.dtype).get_data_type().as_pointer())


@register_model(Grid)
class _GridModel(models.StructModel):
    def __init__(self, dmm: Any, of: Any) -> None:
        super().__init__(dmm, of, [("data", Row(of.dtype)), ("rows", types.intp)])


@register_model(_TablesType)
class _TablesModel(models.StructModel):
    def __init__(self, dmm: Any, of: Any) -> None:
        super().__init__(dmm, of, [("integers", Row(types.int64)), ("floats", Row(types.float64))])


_PAIR = types.UniTuple(types.intp, 2)


def _is_pair(index: Any) -> bool:
    return isinstance(index, types.BaseTuple) and len(index) == 2


@type_callable(operator.getitem)
def _type_of_item(context: Any) -> Any:
    def typed(base: Any, index: Any) -> Any:
        if isinstance(base, Row) and isinstance(index, types.Integer):
            return signature(base.dtype, base, types.intp)
        if isinstance(base, Grid) and isinstance(index, types.Integer):
            return signature(Row(base.dtype), base, types.intp)
        return signature(base.dtype, base, _PAIR) if isinstance(base, Grid) and _is_pair(index) else None

    return typed


@type_callable(operator.setitem)
def _type_of_setting(context: Any) -> Any:
    def typed(base: Any, index: Any, value: Any) -> Any:
        if isinstance(base, Row) and isinstance(index, types.Integer):
            return signature(types.none, base, types.intp, base.dtype)
        return signature(types.none, base, _PAIR, base.dtype) if isinstance(base, Grid) and _is_pair(index) else None

    return typed


@type_callable(len)
def _type_of_length(context: Any) -> Any:
    def typed(base: Any) -> Any:
        return types.intp if isinstance(base, Grid) else None

    return typed


@infer_getattr
class _Attributes(AttributeTemplate):
    key = _TablesType

    def generic_resolve(self, value: Any, name: str) -> Any:
        return _table_type(_NUMBERS[name]) if name in _NUMBERS else None


def _table_type(table: int) -> Grid:
    return Grid(types.int64 if table < INTEGERS else types.float64, WIDTHS[table], constant=True)


def _constant(builder: Any, load: Any) -> Any:
    load.set_metadata("invariant.load", builder.module.add_metadata([]))
    return load


@lower_getattr_generic(_TablesType)
def _table(context: Any, builder: Any, of: Any, value: Any, name: str) -> Any:
    table = _NUMBERS[name]
    tables = cgutils.create_struct_proxy(of)(context, builder, value=value)

    def header(k: int) -> Any:
        at = ir.Constant(ir.IntType(64), 2 * table + k)
        return _constant(builder, builder.load(builder.gep(tables.integers, [at], inbounds=True)))

    grid = cgutils.create_struct_proxy(_table_type(table))(context, builder)
    grid.data = builder.gep(tables.integers if table < INTEGERS else tables.floats, [header(0)], inbounds=True)
    grid.rows = header(1)
    return grid._getvalue()


@lower_builtin(operator.getitem, Row, types.Integer)
def _number_of_row(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.load(builder.gep(args[0], [args[1]], inbounds=True))


@lower_builtin(operator.setitem, Row, types.Integer, types.Any)
def _set_in_row(context: Any, builder: Any, sig: Any, args: Any) -> None:
    builder.store(args[2], builder.gep(args[0], [args[1]], inbounds=True))


def _place(context: Any, builder: Any, of: Grid, value: Any, row: Any, column: Any = None) -> Any:
    grid = cgutils.create_struct_proxy(of)(context, builder, value=value)
    at = builder.mul(row, ir.Constant(row.type, of.width))
    return builder.gep(grid.data, [at if column is None else builder.add(at, column)], inbounds=True)


@lower_builtin(operator.getitem, Grid, types.Integer)
def _row_of_grid(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return _place(context, builder, sig.args[0], args[0], args[1])


@lower_builtin(operator.getitem, Grid, types.UniTuple)
def _number_of_grid(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    row, column = cgutils.unpack_tuple(builder, args[1], 2)
    load = builder.load(_place(context, builder, sig.args[0], args[0], row, column))
    return _constant(builder, load) if sig.args[0].constant else load


@lower_builtin(operator.setitem, Grid, types.UniTuple, types.Any)
def _set_in_grid(context: Any, builder: Any, sig: Any, args: Any) -> None:
    row, column = cgutils.unpack_tuple(builder, args[1], 2)
    builder.store(args[2], _place(context, builder, sig.args[0], args[0], row, column))


@lower_builtin(len, Grid)
def _rows_of_grid(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return cgutils.create_struct_proxy(sig.args[0])(context, builder, value=args[0]).rows


def _data(context: Any, builder: Any, of: Any, array: Any) -> Any:
    return context.make_array(of)(context, builder, array).data


@_intrinsic
def opened(typing: Any, integers: Any, floats: Any) -> Any:
    """Return the tables that lie in two arrays."""

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        tables = cgutils.create_struct_proxy(_TablesType())(context, builder)
        tables.integers = _data(context, builder, sig.args[0], args[0])
        tables.floats = _data(context, builder, sig.args[1], args[1])
        return tables._getvalue()

    return signature(_TablesType(), integers, floats), lower


@_intrinsic
def row(typing: Any, array: Any, start: Any) -> Any:
    """Return the numbers of an array from a place on."""

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.gep(_data(context, builder, sig.args[0], args[0]), [args[1]], inbounds=True)

    return signature(Row(array.dtype), array, types.intp), lower


@_intrinsic(prefer_literal=True)
def grid(typing: Any, array: Any, start: Any, rows: Any, width: Any) -> Any:
    """Return so many rows of an array from a place on; the width is a literal."""
    if not isinstance(width, types.IntegerLiteral):
        return None
    of = Grid(array.dtype, width.literal_value)

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        out = cgutils.create_struct_proxy(of)(context, builder)
        out.data = builder.gep(_data(context, builder, sig.args[0], args[0]), [args[1]], inbounds=True)
        out.rows = args[2]
        return out._getvalue()

    return signature(of, array, types.intp, types.intp, width), lower
