"""Rows of arrays brought into the second-level cache ahead of the phases that copy them.

A block's arrays are longer than the caches, and a chunk of a row is too short for the processor
to see what comes next: at 400² cells the flow waited for memory in a fifth of its time.  A hint to
the processor: no value depends on it, and places outside an array do no harm.  The trap: numba
knows no such hint, so that it is an instruction of LLVM, bound to a plain function that does
nothing (the digest of a kernel's contents then sees a plain function).
"""

from __future__ import annotations

from numba.extending import intrinsic, overload

from hydro.interior import scratch as at
from regrid.jit import compiled_once

READ, SECOND_LEVEL, DATA = 0, 2, 1  # arguments of LLVM's prefetch


def prefetch(array, row, column):
    """Ask for the cache line with the entry (row, column) of a 2-D array."""


@intrinsic
def _prefetch(typing_context, array, row, column):
    from llvmlite import ir
    from numba.core import cgutils, types

    def generate(context, builder, signature, values):
        kind = signature.args[0]
        made = context.make_array(kind)(context, builder, values[0])
        place = cgutils.get_item_pointer(context, builder, kind, made, values[1:], wraparound=False)
        pointer, number = ir.IntType(8).as_pointer(), ir.IntType(32)
        function = cgutils.get_or_insert_function(
            builder.module,
            ir.FunctionType(ir.VoidType(), [pointer, number, number, number]),
            "llvm.prefetch.p0",
        )
        hints = [ir.Constant(number, hint) for hint in (READ, SECOND_LEVEL, DATA)]
        builder.call(function, [builder.bitcast(place, pointer), *hints])
        return context.get_dummy_value()

    return types.void(array, types.intp, types.intp), generate


@overload(prefetch)
def _prefetch_in_kernels(array, row, column):
    return lambda array, row, column: _prefetch(array, row, column)


@compiled_once(allocates=False)
def prefetch_row(source, row, start, count):
    """Ask for source[row, start : start + count]."""
    for k in range(start, start + count + at.LINE, at.LINE):
        prefetch(source, row, k)


@compiled_once(allocates=False)
def prefetch_rows(source, row, start, count):
    """The given row of every component of `source` (components, rows, columns)."""
    for q in range(source.shape[0]):
        prefetch_row(source[q], row, start, count)
