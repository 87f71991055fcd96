"""Is it an equation of state?  What is said of one that lacks a part, before kernels are made."""

from __future__ import annotations

import inspect

from regrid.errors import BadInput

PARTS = ("pressure_part", "energy_part", "sound_speed_squared_part", "least_pressure_part")


def check_eos(block: str, eos: object) -> None:
    """Raise BadInput where `eos` cannot be that of the block: a class, a number, a part missing."""
    where = f"block {block!r}: eos"
    if isinstance(eos, type):
        name = eos.__name__
        raise BadInput(f"{where} is the class {name}; one made of it is wanted, {name}(...)")
    kind = type(eos)
    missing = [name for name in (*PARTS, "opens_voids", "parameters") if not hasattr(kind, name)]
    if len(missing) == len(PARTS) + 2:
        raise BadInput(
            f"{where} is {eos!r}; an equation of state is wanted, such as shockgrid.IdealGas(1.4)"
        )
    if missing:
        raise BadInput(f"{where} is of the class {kind.__name__}, which lacks {', '.join(missing)}")
    for name in PARTS:
        if not isinstance(inspect.getattr_static(kind, name), staticmethod):
            raise BadInput(f"{where}: {kind.__name__}.{name} is no staticmethod({name})")
        if not hasattr(getattr(kind, name), "compiled_as"):
            raise BadInput(
                f"{where}: {kind.__name__}.{name} is not marked with shockgrid.inlined, so that no "
                "kernel can call it"
            )
    try:
        _ = eos.wave_law  # type: ignore[attr-defined]
    except (AttributeError, NotImplementedError):
        raise BadInput(f"{where} is of the class {kind.__name__}, which lacks wave_law") from None
