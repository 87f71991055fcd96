"""Points projected onto a polyline: the position of a node of one line on another."""

from __future__ import annotations

from regrid.jit import compiled_once, kernel

SNAP = 1e-9  # parts of a face closer than this to a master node are at the node
NEAR = 1e-2  # squared distance, in squared lengths of a face, of a point that lies on the line
PARALLEL = 1e-20  # squared sine of the angle below which two lines do not cross


@compiled_once
def measure_square(line, a):
    """Squared length of face `a` of a line."""
    return (line[0, a + 1] - line[0, a]) ** 2 + (line[1, a + 1] - line[1, a]) ** 2


@compiled_once
def project(line, a, point_x, point_y):
    """Part of face `a` of a line nearest to a point (0..1), and the squared distance."""
    x, y = line[0, a], line[1, a]
    dx = line[0, a + 1] - x
    dy = line[1, a + 1] - y
    part = ((point_x - x) * dx + (point_y - y) * dy) / (dx * dx + dy * dy)
    part = min(1.0, max(0.0, part))
    away_x = x + part * dx - point_x
    away_y = y + part * dy - point_y
    return part, away_x * away_x + away_y * away_y


@kernel
def fill_positions(master, points, positions):
    """Positions (n,) on the master (2, m + 1) nearest to the points (2, n), which follow its order.

    A position is looked for from the one before it onwards, so that positions never fall, up to the
    first face behind one that is near.
    """
    start = 0
    last = 0.0
    for k in range(points.shape[1]):
        best, position = 1e300, last
        for a in range(start, master.shape[1] - 1):
            part, away = project(master, a, points[0, k], points[1, k])
            if away < best:
                best, position = away, a + part
            elif best < NEAR * measure_square(master, a):
                break
        nearest = float(int(position + 0.5))
        if abs(position - nearest) < SNAP:
            position = nearest
        last = position if position > last else last
        positions[k] = last
        start = min(int(last), master.shape[1] - 2)


@kernel
def fill_points(line, positions, points):
    """Points (2, n) of a line at the positions (n,)."""
    for k in range(positions.shape[0]):
        a = min(int(positions[k]), line.shape[1] - 2)
        part = positions[k] - a
        for q in range(2):
            points[q, k] = line[q, a] + part * (line[q, a + 1] - line[q, a])


@kernel
def find_last_crossing(line, other):
    """Last crossing along `line` with `other`: (face of line, part, face of other, part).

    Face -1 where there is none.
    """
    for k in range(line.shape[1] - 2, -1, -1):
        x, y = line[0, k], line[1, k]
        dx, dy = line[0, k + 1] - x, line[1, k + 1] - y
        found, found_part, most = -1, 0.0, -1.0
        for a in range(other.shape[1] - 1):
            ex = other[0, a + 1] - other[0, a]
            ey = other[1, a + 1] - other[1, a]
            away_x, away_y = other[0, a] - x, other[1, a] - y
            cross = dx * ey - dy * ex
            if cross * cross <= PARALLEL * (dx * dx + dy * dy) * (ex * ex + ey * ey):
                continue
            along = (away_x * ey - away_y * ex) / cross
            part = (away_x * dy - away_y * dx) / cross
            if 0.0 <= along <= 1.0 and 0.0 <= part <= 1.0 and along > most:
                found, found_part, most = a, part, along
        if found >= 0:
            return k, most, found, found_part
    return -1, 0.0, -1, 0.0
