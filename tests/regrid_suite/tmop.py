"""Nodes by MFEM's target-matrix optimisation paradigm (TMOP), through the `mfem` package.

Every step starts on the last grid with the sides' motion carried inside; Newton's method with
MINRES then minimises the sum of a metric of T = A W^-1 at the nodes of a Gauss-Lobatto rule, A the
Jacobian of a cell's map, W its target.  "shape": metric 2 (302 in space) on squares; "start":
metric 7 (321), shape and size, on the cells of the march's first grid.  The sides' nodes are fixed.

Note: these metrics have a barrier and cannot start on a folded grid; the harness then halves
the step.

Source: [Dobrev2019].
"""

from __future__ import annotations

import mfem.ser as mfem  # codespell:ignore ser
import numpy as np

from regrid_suite.harness import Refused
from regrid_suite.marches import March, get_side, interpolate_faces, name_sides
from shockgrid.regrid.algebraic import fill_displacement

NEWTON = 8
NEWTON_TOLERANCE = 1e-3
LINEAR = 100
LINEAR_TOLERANCE = 1e-3
ORDER = 3  # of the rule: the corners of a cell


class Tmop:
    """A mesh of the march's shape and its optimiser, used again in every step."""

    def __init__(self, march: March, target: str = "shape"):
        self.dim = march.dim
        cells = [n - 1 for n in march.start.shape[1:]]
        if self.dim == 2:
            self.mesh = mfem.Mesh.MakeCartesian2D(
                *cells, mfem.Element.QUADRILATERAL, True, 1.0, 1.0, False
            )
        else:
            self.mesh = mfem.Mesh.MakeCartesian3D(
                *cells, mfem.Element.HEXAHEDRON, 1.0, 1.0, 1.0, False
            )
        self.collection = mfem.H1_FECollection(1, self.dim)
        self.space = mfem.FiniteElementSpace(self.mesh, self.collection, self.dim)
        self.mesh.SetNodalFESpace(self.space)
        self.nodes = mfem.GridFunction(self.space)
        self.mesh.SetNodalGridFunction(self.nodes)
        self.first = mfem.GridFunction(self.space)
        self._put(march.start, self.first)
        self._put(march.start, self.nodes)
        tmop = mfem.tmop
        if target == "shape":
            self.metric = tmop.TMOP_Metric_002() if self.dim == 2 else tmop.TMOP_Metric_302()
            kind = tmop.TargetConstructor.IDEAL_SHAPE_UNIT_SIZE
        else:
            self.metric = tmop.TMOP_Metric_007() if self.dim == 2 else tmop.TMOP_Metric_321()
            kind = tmop.TargetConstructor.GIVEN_SHAPE_AND_SIZE
        self.target = tmop.TargetConstructor(kind)
        self.target.SetNodes(self.first)
        self.rules = mfem.IntegrationRules(0, mfem.Quadrature1D.GaussLobatto)
        integrator = tmop.TMOP_Integrator(self.metric, self.target)
        integrator.SetIntegrationRules(self.rules, ORDER)
        integrator.thisown = False  # the form owns it
        self.integrator = integrator
        self.form = mfem.NonlinearForm(self.space)
        self.form.AddDomainIntegrator(integrator)
        self.fixed = mfem.intArray([1] * self.mesh.bdr_attributes.Max())
        self.form.SetEssentialBC(self.fixed)
        self.linear = mfem.MINRESSolver()
        self.linear.SetMaxIter(LINEAR)
        self.linear.SetRelTol(LINEAR_TOLERANCE)
        self.linear.SetAbsTol(0.0)
        self.linear.SetPrintLevel(-1)
        kind_of_cell = self.space.GetFE(0).GetGeomType()
        self.solver = tmop.TMOPNewtonSolver(self.rules.Get(kind_of_cell, ORDER), 0)
        self.solver.SetIntegrationRules(self.rules, ORDER)
        self.solver.SetPreconditioner(self.linear)
        self.solver.SetMaxIter(NEWTON)
        self.solver.SetRelTol(NEWTON_TOLERANCE)
        self.solver.SetAbsTol(0.0)
        self.solver.SetPrintLevel(-1)
        self.solver.SetOperator(self.form)
        self.right = mfem.Vector(0)

    def _put(self, nodes: np.ndarray, function) -> None:
        """Nodes (dim, ni+1, nj+1[, nk+1]) into a function whose vertices have i running first."""
        data = function.GetDataArray()
        data[:] = np.concatenate([c.ravel(order="F") for c in nodes])

    def __call__(self, previous: np.ndarray, boundary: np.ndarray) -> np.ndarray:
        start = carry(previous, boundary)
        self._put(start, self.nodes)
        if least_determinant(start) <= 0.0:
            raise Refused("the grid to start from is folded", start)
        self.nodes.SetTrueVector()
        self.solver.Mult(self.right, self.nodes.GetTrueVector())
        self.nodes.SetFromTrueVector()
        shape = boundary.shape[1:]
        found = np.array(self.nodes.GetDataArray()).reshape(self.dim, -1)
        nodes = np.array([component.reshape(shape, order="F") for component in found])
        for side in name_sides(self.dim):
            get_side(nodes, side)[...] = get_side(boundary, side)
        return nodes


def carry(previous: np.ndarray, boundary: np.ndarray) -> np.ndarray:
    """The last grid with the motion of the sides carried inside (theory R6.5)."""
    motion = np.zeros_like(previous)
    if len(previous) == 2:
        fill_displacement(previous, boundary, motion)
    else:
        for side in name_sides(3):
            get_side(motion, side)[...] = get_side(boundary, side) - get_side(previous, side)
        motion = interpolate_faces(motion)
    nodes = previous + motion
    for side in name_sides(len(previous)):
        get_side(nodes, side)[...] = get_side(boundary, side)
    return nodes


def least_determinant(nodes: np.ndarray) -> float:
    """Least determinant of the edges at all corners of all cells."""
    from shockgrid.regrid.measure.hexahedra import compute_least_corner_volumes
    from shockgrid.regrid.measure.quality import compute_corner_areas

    compute = compute_corner_areas if len(nodes) == 2 else compute_least_corner_volumes
    return float(compute(nodes).min())
