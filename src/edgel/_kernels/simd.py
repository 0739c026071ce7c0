"""Eight float64 in step: explicit SIMD inside kernels.

A kernel that keeps one query, or one point, in each lane reads like its scalar version, and its sums do not depend on
how many lanes a machine has. LLVM does not find this by itself: it vectorises inner loops only, and may not reorder
floating-point sums. It turns eight lanes into one AVX-512 operation, two of AVX2, or four of SSE2 or NEON.

>>> import numpy as np
>>> from numba import njit
>>> @njit
... def hypotenuse(a, b, out):
...     x, y = load(a, 0), load(b, 0)
...     store(out, 0, root(x * x + y * y))
>>> out = np.empty(8)
>>> hypotenuse(np.full(8, 3.0), np.arange(8.0), out)
>>> float(out[4])
5.0
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import config, types
from numba.core.errors import TypingError
from numba.core.typeconv.castgraph import Conversion  # pyright: ignore[reportPrivateImportUsage]
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, lower_cast, models, register_model

LANES = 8
_intrinsic: Any = intrinsic  # what it makes of a function has another signature


class Floats(types.Type):
    """The type of eight float64; a float64 among them stands for eight equal ones."""

    llvm = ir.VectorType(ir.DoubleType(), LANES)

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Tell Numba that a float64 may take the place of eight."""
        return Conversion.safe if other == types.float64 else None


class Counts(types.Type):
    """The type of eight int64; an int64 among them stands for eight equal ones."""

    llvm = ir.VectorType(ir.IntType(64), LANES)

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Tell Numba that an int64 may take the place of eight."""
        return Conversion.safe if isinstance(other, types.Integer) else None


class Flags(types.Type):
    """The type of eight truth values."""

    llvm = ir.VectorType(ir.IntType(1), LANES)


floats, counts, flags = Floats("Floats"), Counts("Counts"), Flags("Flags")


def _register(lanes: Any) -> None:
    class Model(models.PrimitiveModel):
        def __init__(self, manager: Any, fe_type: Any) -> None:
            super().__init__(manager, fe_type, lanes.llvm)

    register_model(lanes)(Model)


for _type in (Floats, Counts, Flags):
    _register(_type)


def _spread(builder: Any, value: Any, vector: Any) -> Any:
    undefined = ir.Constant(vector, ir.Undefined)
    first = builder.insert_element(undefined, value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first, undefined, ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES))


@lower_cast(types.Float, Floats)
def _spread_float(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    return _spread(builder, value, Floats.llvm)


@lower_cast(types.Integer, Counts)
def _spread_int(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    return _spread(builder, context.cast(builder, value, source, types.int64), Counts.llvm)


def _operator(function: Callable[..., Any], result: Any, operand: Any, build: Callable[..., Any]) -> None:
    @infer_global(function)  # pyright: ignore[reportOptionalCall]
    class Template(ConcreteTemplate):
        cases = [signature(result, operand, operand)]  # noqa: RUF012

    @lower_builtin(function, operand, operand)
    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return build(builder, *args)


_operator(operator.add, floats, floats, lambda builder, a, b: builder.fadd(a, b))
_operator(operator.add, counts, counts, lambda builder, a, b: builder.add(a, b))
_operator(operator.sub, floats, floats, lambda builder, a, b: builder.fsub(a, b))
_operator(operator.mul, floats, floats, lambda builder, a, b: builder.fmul(a, b))
_operator(operator.truediv, floats, floats, lambda builder, a, b: builder.fdiv(a, b))
_operator(operator.and_, flags, flags, lambda builder, a, b: builder.and_(a, b))
_operator(operator.or_, flags, flags, lambda builder, a, b: builder.or_(a, b))
_COMPARISONS = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq}
for _sign, _compare in _COMPARISONS.items():
    _operator(_compare, flags, floats, lambda builder, a, b, sign=_sign: builder.fcmp_ordered(sign, a, b))
    _operator(_compare, flags, counts, lambda builder, a, b, sign=_sign: builder.icmp_signed(sign, a, b))


def _call(builder: Any, name: str, *operands: Any) -> Any:
    """Call one of LLVM's own functions, all of whose operands have the type of its result."""
    kind = operands[0].type
    function_type = ir.FunctionType(kind, [kind] * len(operands))
    module = builder.module
    full = f"llvm.{name}.v{LANES}f64"
    function = module.globals.get(full) or ir.Function(module, function_type, full)
    return builder.call(function, operands)


def _place(context: Any, builder: Any, kind: Any, array: Any, i: Any, *, checked: bool = True) -> Any:
    made = context.make_array(kind)(context, builder, array)
    if checked and config.BOUNDSCHECK:  # pyright: ignore[reportAttributeAccessIssue]
        size, zero = builder.extract_value(made.shape, 0), ir.Constant(i.type, 0)
        end = builder.add(i, ir.Constant(i.type, LANES))
        outside = builder.or_(builder.icmp_signed("<", i, zero), builder.icmp_signed(">", end, size))
        with builder.if_then(outside, likely=False):
            context.call_conv.return_user_exc(builder, IndexError, ("eight numbers beyond the end of an array",))
    return builder.bitcast(builder.gep(made.data, [i]), Floats.llvm.as_pointer())


def _check(array: Any) -> None:
    if array.dtype != types.float64 or array.ndim != 1 or array.layout != "C":
        raise TypingError(f"lanes are read from and written to contiguous (N,) float64, not {array}")


@_intrinsic
def load(typing: Any, array: Any, i: Any) -> Any:
    """Read array[i : i + 8] of a contiguous (N,) float64."""
    _check(array)

    def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.load(_place(context, builder, sig.args[0], *args), align=8)

    return floats(array, types.intp), build


@_intrinsic
def load_padded(typing: Any, array: Any, i: Any) -> Any:
    """Read array[i : i + 8] where the array ends before, and whoever made it left memory behind it.

    Unlike `load` it is not checked under ``NUMBA_BOUNDSCHECK``.
    """
    _check(array)

    def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.load(_place(context, builder, sig.args[0], *args, checked=False), align=8)

    return floats(array, types.intp), build


@_intrinsic
def store(typing: Any, array: Any, i: Any, values: Any) -> Any:
    """Write array[i : i + 8] of a contiguous (N,) float64."""
    _check(array)

    def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        builder.store(args[2], _place(context, builder, sig.args[0], *args[:2]), align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, floats), build


def _function(result: Any, *operands: Any) -> Callable[[Callable[..., Any]], Any]:
    """Make a function of lanes of one that builds its LLVM code from a builder and the operands."""

    def decorate(build: Callable[..., Any]) -> Any:
        # Numba counts the parameters, so each number of them needs a function of its own.
        def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return build(builder, *args)

        def none(typing: Any) -> Any:
            return result(), code

        def one(typing: Any, a: Any) -> Any:
            return result(*operands), code

        def two(typing: Any, a: Any, b: Any) -> Any:
            return result(*operands), code

        def three(typing: Any, a: Any, b: Any, c: Any) -> Any:
            return result(*operands), code

        typed = (none, one, two, three)[len(operands)]
        typed.__name__, typed.__doc__ = build.__name__, build.__doc__
        return _intrinsic(typed)

    return decorate


@_function(floats, types.float64)
def spread(builder: Any, value: Any) -> Any:
    """Eight times the same float64."""
    return _spread(builder, value, Floats.llvm)


@_function(counts, types.int64)
def counts_of(builder: Any, value: Any) -> Any:
    """Eight times the same int64."""
    return _spread(builder, value, Counts.llvm)


@_function(counts, counts, flags)
def counted(builder: Any, count: Any, flag: Any) -> Any:
    """One more in each lane whose flag is set."""
    return builder.add(count, builder.zext(flag, Counts.llvm))


@_function(floats, counts)
def as_floats(builder: Any, count: Any) -> Any:
    """Turn counts into float64."""
    return builder.sitofp(count, Floats.llvm)


@_function(floats, flags, floats, floats)
def where(builder: Any, flag: Any, yes: Any, no: Any) -> Any:
    """Take `yes` in each lane whose flag is set, `no` in the others."""
    return builder.select(flag, yes, no)


@_function(counts, flags, counts, counts)
def where_counts(builder: Any, flag: Any, yes: Any, no: Any) -> Any:
    """`where` for counts."""
    return builder.select(flag, yes, no)


@_function(floats, floats, floats, floats)
def multiply_add(builder: Any, a: Any, b: Any, c: Any) -> Any:
    """``a * b + c``, rounded once where the processor can."""
    return _call(builder, "fmuladd", a, b, c)


@_function(floats, floats)
def root(builder: Any, a: Any) -> Any:
    """Square root."""
    return _call(builder, "sqrt", a)


@_function(floats, floats)
def magnitude(builder: Any, a: Any) -> Any:
    """Absolute value."""
    return _call(builder, "fabs", a)


@_function(floats, floats, floats)
def smaller(builder: Any, a: Any, b: Any) -> Any:
    """The smaller of both in each lane."""
    return builder.select(builder.fcmp_ordered("<", a, b), a, b)


@_function(floats, floats, floats)
def larger(builder: Any, a: Any, b: Any) -> Any:
    """The larger of both in each lane."""
    return builder.select(builder.fcmp_ordered(">", a, b), a, b)


@_function(types.uint8, flags)
def bits(builder: Any, flag: Any) -> Any:
    """Bit i is the flag of lane i: 0 where none is set, 255 where all are."""
    return builder.bitcast(flag, ir.IntType(LANES))


def _reduced(builder: Any, values: Any, sign: str) -> Any:
    width = LANES
    while width > 1:  # fold the upper half onto the lower
        width //= 2
        undefined = ir.Constant(values.type, ir.Undefined)
        index = ir.VectorType(ir.IntType(32), width)
        lower = builder.shuffle_vector(values, undefined, ir.Constant(index, list(range(width))))
        upper = builder.shuffle_vector(values, undefined, ir.Constant(index, list(range(width, 2 * width))))
        values = builder.select(builder.fcmp_ordered(sign, lower, upper), lower, upper)
    return builder.extract_element(values, ir.Constant(ir.IntType(32), 0))


@_function(types.float64, floats)
def smallest_of(builder: Any, values: Any) -> Any:
    """The smallest of the eight."""
    return _reduced(builder, values, "<")


@_function(types.float64, floats)
def largest_of(builder: Any, values: Any) -> Any:
    """The largest of the eight."""
    return _reduced(builder, values, ">")
