"""Implosions and blasts on rectangular grids: Noh's and Sedov's problems against exact theory."""

import numpy as np
import pytest

from builders import march, march_measured
from problems.references.sedov import SedovBlast
from problems.standard.noh import Noh, NohDeck
from problems.standard.sedov import Sedov, SedovDeck


@pytest.mark.parametrize(
    ("geometry", "alpha"),
    [("plane", 1.07748558), ("cylindrical", 0.98407402), ("spherical", 0.85107185)],
)
def test_sedov_reference(geometry, alpha):
    """The energy of the profile, computed independently; mass; Rankine and Hugoniot's jump."""
    blast = SedovBlast(geometry, energy=alpha)
    assert blast.alpha == pytest.approx(alpha, rel=1e-5)
    assert blast.radius(1.0) == pytest.approx(1.0, rel=1e-5)
    n = blast.dimensions
    r = np.linspace(0.0, 0.99999, 20001)
    rho, u, p = blast.sample(r, 1.0)
    mass = np.trapezoid(rho * r ** (n - 1), r)
    assert mass == pytest.approx(1.0 / n, rel=1e-3)
    speed = 2.0 / (n + 2.0)
    assert rho[-1] == pytest.approx(6.0, rel=1e-3)
    assert u[-1] == pytest.approx(speed / 1.2, rel=1e-3)
    assert p[-1] == pytest.approx(speed**2 / 1.2, rel=1e-3)


@pytest.mark.parametrize(
    ("geometry", "bar", "behind"),
    [("plane", 0.0145, 4.0), ("cylindrical", 0.025, 16.0), ("spherical", 0.047, 64.0)],
)
def test_noh(geometry, bar, behind):
    problem = Noh(NohDeck(geometry=geometry))
    simulation = problem.build()
    history = march_measured(problem, simulation)
    assert history["error_rho"][-1] < bar
    assert history["density_behind"][-1] == pytest.approx(behind, rel=0.06)
    assert history["pressure_behind"][-1] == pytest.approx(behind / 3.0, rel=0.06)
    rho, u, v, p = simulation.blocks[0].state[:, 1:-1, 1:-1]
    if geometry == "cylindrical":  # x and y are the same
        for one, other in ((rho, rho.T), (u, v.T), (p, p.T)):
            assert np.abs(one - other).max() < 1e-10
    summary = problem.summary(history, simulation)
    assert f"{history['error_rho'][-1]:.4f}" in summary and f"({behind:.4g})" in summary


@pytest.mark.parametrize(
    ("geometry", "bar"), [("plane", 0.045), ("cylindrical", 0.0136), ("spherical", 0.0285)]
)
def test_sedov(geometry, bar):
    problem = Sedov(SedovDeck(geometry=geometry))
    simulation = problem.build()
    history = march_measured(problem, simulation)
    assert history["error_rho"][-1] < bar
    assert history["shock_radius"][-1] == pytest.approx(1.0, abs=0.008)
    energy = history["total_energy"]
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-12, "nothing passes the walls"
    assert (history["least_scaled_jacobian"] > 0.0).all()
    assert "energy changed by" in problem.summary(history, simulation)


@pytest.mark.parametrize(
    ("geometry", "gamma"),
    [("plane", 3.0), ("cylindrical", 3.0), ("spherical", 2.5), ("plane", 6.5)],
)
def test_the_shock_is_found_at_every_gamma(geometry, gamma):
    """The density rises to 2, 2.33 and 1.36; a cell is .024 wide."""
    problem = Sedov(SedovDeck(geometry=geometry, gamma=gamma, cells=50))
    simulation = problem.build()
    march(simulation)
    assert problem.measure(simulation)["shock_radius"] == pytest.approx(1.0, abs=0.018)


def test_restart_of_a_grid_that_follows():
    one, two = Sedov(SedovDeck(cells=24, geometry="spherical")), None
    first = one.build()
    march(first, 8)
    two = Sedov(SedovDeck(cells=24, geometry="spherical"))
    again = two.build()
    again.set_state(first.get_state())
    march(first, 8)
    march(again, 8)
    for name, value in first.get_state().items():
        assert np.array_equal(value, again.get_state()[name]), name
