"""The gauges of a deck one by one: lines of them cut into points, each with a name of its own."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from problems.deck import Gauge
from regrid.errors import BadInput

MOST_POINTS = 10_000  # of all gauges together


@dataclass(frozen=True)
class GaugePoint:
    """One gauge: its name, first place [m], whether it goes with the material, and its fields."""

    name: str
    at: tuple[float, float]
    moves: bool
    fields: tuple[str, ...]


def place_gauges(tables: Iterable[Gauge]) -> list[GaugePoint]:
    """All points of the `[[gauge]]` tables, in their order.

    Raises BadInput for a name that comes twice and for a line without `to` or of one point.
    """
    tables = list(tables)
    if (count := sum(gauge.count for gauge in tables)) > MOST_POINTS:
        raise BadInput(f"deck: gauge: {count} points in all; at most {MOST_POINTS} are followed")
    points: list[GaugePoint] = []
    for number, gauge in enumerate(tables):
        key = f"deck: gauge.{number} ({gauge.name!r})"
        if (gauge.to is None) != (gauge.count == 1):
            missing = "a line needs its end `to`" if gauge.to is None else "give `count` above 1"
            raise BadInput(f"{key}: count = {gauge.count}; {missing}")
        fields = tuple(dict.fromkeys(gauge.fields))
        for k in range(gauge.count):
            part = k / (gauge.count - 1) if gauge.to else 0.0
            (x, y), (x_end, y_end) = gauge.at, gauge.to or gauge.at
            at = (1.0 - part) * x + part * x_end, (1.0 - part) * y + part * y_end
            name = f"{gauge.name}_{k + 1}" if gauge.to else gauge.name
            points.append(GaugePoint(name, at, gauge.moves, fields))
    columns: dict[str, str] = {"step": "the step", "t": "the time", "outside": "a count"}
    for point in points:
        for column in list_columns(point):
            if column in columns:
                raise BadInput(
                    f"deck: gauge {point.name!r} would write the column {column!r}, which is that "
                    f"of {columns[column]!r} already; give it another name"
                )
            columns[column] = point.name
    return points


def list_columns(point: GaugePoint) -> list[str]:
    """Names of the columns that a gauge has in gauges.csv: place (if it moves), block, fields."""
    own = ["x", "y"] if point.moves else []
    return [f"{point.name}_{word}" for word in (*own, "block", *point.fields)]
