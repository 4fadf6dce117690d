"""Eight numbers side by side in compiled loops: one instruction works on all of them.

A recursion over samples cannot be vectorised in time. Eight signals can go through it at once,
which the compiler does not find by itself; here it is said. A *row* is what :func:`row` reads
from eight numbers that follow each other in memory and :func:`put` writes back; rows are added,
subtracted, multiplied and divided, and multiplied by a number. In type hints a row is an array
of LANES numbers; there are none outside compiled code.
"""

import operator
from collections.abc import Callable
from typing import Any, cast

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, overload, register_model

from stiction_ros.effects.behaviour import FloatArray

LANES = 8

_Rule = Callable[..., Any]
_compiled_in_place = cast(Callable[[_Rule], _Rule], intrinsic)

_VECTOR = ir.VectorType(ir.DoubleType(), LANES)
_PLACES = ir.VectorType(ir.IntType(32), LANES)


class _Row(types.Type):
    """LANES numbers in one register."""

    def __init__(self) -> None:
        super().__init__(name=f"Row({LANES})")


_ROW = _Row()


@register_model(_Row)
class _RowModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: _Row) -> None:
        cast(Any, super()).__init__(manager, kind, _VECTOR)


def _holds_rows(kind: Any) -> bool:
    return isinstance(kind, types.Array) and kind.dtype is types.float64 and kind.layout == "C"


def _memory(context: Any, builder: Any, kind: Any, array: Any, at: Any) -> Any:
    """Return the address of LANES numbers of a contiguous array from its element ``at`` on."""
    data = context.make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [at]), _VECTOR.as_pointer())


def _filled(builder: Any, value: Any) -> Any:
    one = builder.insert_element(_VECTOR(ir.Undefined), value, cgutils.int32_t(0))
    return builder.shuffle_vector(one, _VECTOR(ir.Undefined), _PLACES([0] * LANES))


@_compiled_in_place
def _row(typing: Any, array: Any, at: Any) -> Any:
    if not _holds_rows(array):
        return None

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = _memory(context, builder, signature.args[0], arguments[0], arguments[1])
        return builder.load(place, align=8)

    return _ROW(array, types.intp), generate


@_compiled_in_place
def _put(typing: Any, array: Any, at: Any, value: Any) -> Any:
    if not _holds_rows(array):
        return None

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = _memory(context, builder, signature.args[0], arguments[0], arguments[1])
        builder.store(arguments[2], place, align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, _ROW), generate


@_compiled_in_place
def _spread(typing: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _filled(builder, arguments[0])

    return _ROW(types.float64), generate


@_compiled_in_place
def _halves_swapped(typing: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        order = [(lane + LANES // 2) % LANES for lane in range(LANES)]
        return builder.shuffle_vector(arguments[0], _VECTOR(ir.Undefined), _PLACES(order))

    return _ROW(_ROW), generate


@_compiled_in_place
def _larger(typing: Any, one: Any, two: Any, yes: Any, no: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        one, two, yes, no = arguments
        return builder.select(builder.fcmp_ordered(">", one, two), yes, no)

    return _ROW(_ROW, _ROW, _ROW, _ROW), generate


row = cast(Callable[[FloatArray, int], FloatArray], _row)
"""Return LANES numbers of a C-contiguous array from its element ``at`` on, its flat index."""

put = cast(Callable[[FloatArray, int, FloatArray], None], _put)
"""Write a row where :func:`row` reads it."""

spread = cast(Callable[[float], FloatArray], _spread)
"""Return a row of equal numbers."""

halves_swapped = cast(Callable[[FloatArray], FloatArray], _halves_swapped)
"""Return a row with its second half before its first."""

where_larger = cast(Callable[[FloatArray, FloatArray, FloatArray, FloatArray], FloatArray], _larger)
"""Return the third row where the first is larger than the second, elsewhere the fourth."""


def _by_lanes(method: str) -> Any:
    @_compiled_in_place
    def compute(typing: Any, one: Any, two: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return getattr(builder, method)(*arguments)

        return _ROW(_ROW, _ROW), generate

    return compute


_sum, _difference = _by_lanes("fadd"), _by_lanes("fsub")
_product, _quotient = _by_lanes("fmul"), _by_lanes("fdiv")


# Numba wants an overload to have the very parameters of what it returns, annotations included.
@overload(operator.add)
def _add(one: Any, two: Any) -> Any:
    def both(one: Any, two: Any) -> Any:
        return _sum(one, two)

    return both if one is _ROW and two is _ROW else None


@overload(operator.sub)
def _subtract(one: Any, two: Any) -> Any:
    def both(one: Any, two: Any) -> Any:
        return _difference(one, two)

    return both if one is _ROW and two is _ROW else None


@overload(operator.mul)
def _multiply(one: Any, two: Any) -> Any:
    def both(one: Any, two: Any) -> Any:
        return _product(one, two)

    def scaled(one: Any, two: Any) -> Any:
        return _product(_spread(one), two)

    if two is not _ROW:
        return None
    return both if one is _ROW else scaled if one is types.float64 else None


@overload(operator.truediv)
def _divide(one: Any, two: Any) -> Any:
    def both(one: Any, two: Any) -> Any:
        return _quotient(one, two)

    return both if one is _ROW and two is _ROW else None
