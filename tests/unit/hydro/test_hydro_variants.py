"""Kernels made by factories are named by their variant: machine code is linked by name."""

import itertools

from hydro.eos import IdealGas, StiffenedGas
from hydro.formulas.geometry import PLANE
from hydro.formulas.reconstruction import LIMITERS
from hydro.formulas.riemann import FLUXES
from hydro.interior.advance import make_flow_kernels
from hydro.perimeter.strips import make_side_kernels


def test_closures_are_named_by_what_they_hold():
    """No two variants share a name, or they could be taken for one another from the disk cache."""
    names, count = set(), 0
    for eos_class in (IdealGas, StiffenedGas):
        for limiter, flux in itertools.product(LIMITERS, FLUXES):
            kernels = [*make_flow_kernels(eos_class, limiter, PLANE, flux)]
            kernels.append(make_side_kernels(eos_class, limiter, PLANE, flux).predict_sides)
            names |= {kernel.py_func.__qualname__ for kernel in kernels}
            count += len(kernels)
    assert len(names) == count
