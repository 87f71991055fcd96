"""SI prefixes of numbers that people read: (1e-9, "GPa") for a pressure of some 1e10 Pa."""

from __future__ import annotations

import math

PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}
PREFIXED = ("m", "s", "m/s", "Pa", "J", "J/kg", "N", "B")


def pick_prefix(largest: float, unit: str) -> tuple[float, str]:
    """Factor and unit that bring a quantity of size `largest` near 1 to 1000: (1e-9, "GPa")."""
    if unit not in PREFIXED or not math.isfinite(largest) or largest == 0:
        return 1.0, "" if unit == "1" else unit
    power = 3 * math.floor(math.log10(abs(largest) * 1.0000001) / 3)
    power = min(max(power, -12), {"m": 3, "s": 0}.get(unit, 12))
    return 10.0**-power, PREFIXES[power] + unit
