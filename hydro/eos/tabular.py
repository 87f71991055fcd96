"""Tabular p(rho, e): a table from an HDF5 file, bilinear between its points.

The file has datasets `rho` (n,) [kg/m³] and `e` (m,) [J/kg], both increasing, and `p` (n, m) [Pa],
increasing along both.  Bilinear interpolation keeps it increasing and is inverted exactly for
e(rho, p).  The sound speed is that of the interpolated surface, so all three agree to round-off.
Note: nothing is extrapolated.  A state outside the table is NaN in the kernels, and the step fails
with a message.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from shockgrid.hydro.eos.base import EquationOfState
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.hdf5_files import open_hdf5
from shockgrid.regrid.jit import choose, compiled_once, inlined


@compiled_once
def find_interval(axis, value):
    """i with axis[i] <= value <= axis[i + 1]; outside the axis the nearest interval."""
    last = axis.size - 2
    i = np.searchsorted(axis, value, side="right") - 1
    i = choose(i > 0, i, 0)
    return choose(i < last, i, last)


@compiled_once
def is_inside(axis, value):
    """Whether a value lies on the axis; NaN does not."""
    return (axis[0] <= value) & (value <= axis[axis.size - 1])


@compiled_once
def interpolate(table, i, k, a):
    """Pressure at the part `a` from density i to i + 1, at the energy k."""
    return table[i, k] + a * (table[i + 1, k] - table[i, k])


@compiled_once
def find_pressure(axis_rho, axis_e, table, rho, e):
    """Pressure, dp/drho and dp/de; NaN outside the table."""
    i = find_interval(axis_rho, rho)
    k = find_interval(axis_e, e)
    width = axis_rho[i + 1] - axis_rho[i]
    height = axis_e[k + 1] - axis_e[k]
    a = (rho - axis_rho[i]) / width
    b = (e - axis_e[k]) / height
    low = interpolate(table, i, k, a)
    high = interpolate(table, i, k + 1, a)
    rise_low = table[i + 1, k] - table[i, k]
    rise_high = table[i + 1, k + 1] - table[i, k + 1]
    inside = is_inside(axis_rho, rho) & is_inside(axis_e, e)
    return (
        choose(inside, low + b * (high - low), np.nan),
        choose(inside, (rise_low + b * (rise_high - rise_low)) / width, np.nan),
        choose(inside, (high - low) / height, np.nan),
    )


@compiled_once
def find_energy(axis_rho, axis_e, table, rho, p):
    """Energy for the given density and pressure; NaN if the table has none."""
    i = find_interval(axis_rho, rho)
    a = (rho - axis_rho[i]) / (axis_rho[i + 1] - axis_rho[i])
    low = 0 * i
    high = low + (axis_e.size - 1)
    inside = is_inside(axis_rho, rho)
    inside = inside & (interpolate(table, i, low, a) <= p) & (p <= interpolate(table, i, high, a))
    # bisection: as many halvings as the longest interval needs, those of one cell change nothing
    remaining = axis_e.size - 1
    while remaining > 1:
        middle = (low + high) // 2
        is_above = interpolate(table, i, middle, a) <= p
        low, high = choose(is_above, middle, low), choose(is_above, high, middle)
        remaining = (remaining + 1) // 2
    high = low + 1
    p_low = interpolate(table, i, low, a)
    p_high = interpolate(table, i, high, a)
    e = axis_e[low] + (axis_e[high] - axis_e[low]) * ((p - p_low) / (p_high - p_low))
    return choose(inside, e, np.nan)


@inlined
def pressure(rho, e, parameters):
    """Pressure [Pa] from density [kg/m³] and specific internal energy [J/kg]."""
    axis_rho, axis_e, table = parameters
    return find_pressure(axis_rho, axis_e, table, rho, e)[0]


@inlined
def energy(rho, p, parameters):
    """Specific internal energy [J/kg] from density [kg/m³] and pressure [Pa]."""
    axis_rho, axis_e, table = parameters
    return find_energy(axis_rho, axis_e, table, rho, p)


@inlined
def sound_speed_squared(rho, p, parameters):
    """c² [m²/s²] from density [kg/m³] and pressure [Pa]."""
    axis_rho, axis_e, table = parameters
    e = find_energy(axis_rho, axis_e, table, rho, p)
    _, slope_rho, slope_e = find_pressure(axis_rho, axis_e, table, rho, e)
    return slope_rho + p / (rho * rho) * slope_e


@inlined
def least_pressure(parameters):
    """Pressure [Pa] below which the material fails: none, the table sets the limit."""
    return -1e300


@dataclass(frozen=True)
class Tabular(EquationOfState):
    """Table in the HDF5 file `path`.

    Raises BadInput for a file that cannot be read, for axes or pressures that do not increase, and
    for a state outside the table in calls from Python.
    """

    path: str = ""
    digest: str = field(init=False, repr=False)  # of the numbers: what tells two tables apart
    axis_rho: np.ndarray = field(init=False, repr=False, compare=False)
    axis_e: np.ndarray = field(init=False, repr=False, compare=False)
    table: np.ndarray = field(init=False, repr=False, compare=False)

    kind = "tabular"
    failure_cause = "left-table"
    pressure_part = staticmethod(pressure)
    energy_part = staticmethod(energy)
    sound_speed_squared_part = staticmethod(sound_speed_squared)
    least_pressure_part = staticmethod(least_pressure)
    opens_voids = False
    has_kinks = True  # a table may hold any phase transition

    def __post_init__(self):
        # the arrays, from the file
        if not Path(self.path).is_file():
            raise BadInput(f"table: there is no file {self.path!r}")
        try:
            with open_hdf5(self.path) as file:
                arrays = [np.array(file[name], dtype=np.float64) for name in ("rho", "e", "p")]
        except (OSError, KeyError) as error:
            raise BadInput(
                f"table {self.path}: it must be an HDF5 file with datasets rho, e and p ({error})"
            ) from None
        rho, e, p = arrays
        # of one size, rising
        axes = (rho.ndim, e.ndim) == (1, 1) and min(rho.size, e.size) > 1
        if not axes or p.shape != (rho.size, e.size):
            raise BadInput(
                f"table {self.path}: rho has shape {rho.shape}, e {e.shape} and p {p.shape}; they "
                "must be (n,), (m,) and (n, m) with at least 2 points each way"
            )
        for name, values, axis in (("rho", rho, 0), ("e", e, 0), ("p", p, 0), ("p", p, 1)):
            steps = np.diff(values, axis=axis)
            if not (steps > 0.0).all():
                entry = tuple(int(k) for k in np.argwhere(~(steps > 0.0))[0])
                along = "" if values.ndim == 1 else f" along {('rho', 'e')[axis]}"
                raise BadInput(
                    f"table {self.path}: {name} must rise{along}; it does not after entry {entry}"
                )
        if rho[0] <= 0.0:
            raise BadInput(f"table {self.path}: rho starts at {rho[0]:g}; it must be positive")
        # frozen: set as a dataclass sets its fields
        for name, values in zip(("axis_rho", "axis_e", "table"), arrays, strict=True):
            object.__setattr__(self, name, np.ascontiguousarray(values))
        contents = b"".join(values.tobytes() for values in (rho, e, p))
        object.__setattr__(self, "digest", hashlib.sha256(contents).hexdigest())

    @property
    def parameters(self) -> tuple[np.ndarray, ...]:
        """The axes and the table."""
        return self.axis_rho, self.axis_e, self.table

    @property
    def failure(self) -> str:
        """Message for a cell whose state has no pressure."""
        return (
            f"its state is outside the table {self.path} (rho {self.axis_rho[0]:g} to "
            f"{self.axis_rho[-1]:g} kg/m3, e {self.axis_e[0]:g} to {self.axis_e[-1]:g} J/kg)"
        )

    @property
    def limits(self) -> str:
        """The states that the table has."""
        return (
            f"the table {self.path} has states of rho {self.axis_rho[0]:g} to "
            f"{self.axis_rho[-1]:g} kg/m3 and e {self.axis_e[0]:g} to {self.axis_e[-1]:g} J/kg, p "
            f"{self.table[0, 0]:g} to {self.table[-1, -1]:g} Pa"
        )

    @property
    def wave_law(self) -> tuple[float, float, float]:
        """Wave curve of an ideal gas with the stiffness rho c²/p of the middle of the table."""
        rho = self.axis_rho[self.axis_rho.size // 2]
        e = self.axis_e[self.axis_e.size // 2]
        p, by_rho, by_e = find_pressure(*self.parameters, rho, e)
        gamma = rho * (by_rho + p / rho**2 * by_e) / p if p > 0.0 else 3.0
        slope = 0.25 * (min(max(gamma, 1.05), 7.0) + 1.0)
        return slope, slope, 0.0

    def _check(self, values, rho, second_argument, name: str):
        is_bad = ~np.isfinite(values)
        if np.any(is_bad):
            rho, second_argument = (
                np.broadcast_to(value, np.shape(values)) for value in (rho, second_argument)
            )
            first_bad = np.argmax(is_bad)
            unit = {"e": "J/kg", "p": "Pa"}[name]
            failure = self.failure.removeprefix("its state is ")
            raise BadInput(
                f"the state rho = {np.ravel(rho)[first_bad]:g} kg/m3, {name} = "
                f"{np.ravel(second_argument)[first_bad]:g} {unit} is {failure}"
            )
        return values

    def pressure(self, rho, e):
        """Pressure [Pa]; BadInput outside the table."""
        return self._check(super().pressure(rho, e), rho, e, "e")

    def energy(self, rho, p):
        """Specific internal energy [J/kg]; BadInput outside the table."""
        return self._check(super().energy(rho, p), rho, p, "p")
