"""The exact Riemann solver against a table computed independently in double precision."""

import math

import numpy as np
import pytest

from hydro.eos import IdealGas, MieGruneisen, StiffenedGas
from problems.references.riemann import compute_cell_averages, solve_riemann
from regrid.errors import BadInput

AIR = IdealGas(1.4)
AL = MieGruneisen(2.707, 5.386, 1.339, 1.97)
SS = MieGruneisen(7.896, 4.569, 1.490, 2.17)
PB = MieGruneisen(11.350, 2.051, 1.46, 2.77)

# eos, (rho, u, p) left and right, then p*, u*, rho_left*, rho_right*
GASES = {
    "sod": (AIR, (1, 0, 1), AIR, (0.125, 0, 0.1))
    + (0.3031301781, 0.92745262, 0.4263194282, 0.2655737117),
    "123": (AIR, (1, -2, 0.4), AIR, (1, 2, 0.4))
    + (0.00189387342, 0.0, 0.02185211821, 0.02185211821),
    "toro 3": (AIR, (1, 0, 1000), AIR, (1, 0, 0.01))
    + (460.8937875, 19.59745139, 0.5750622985, 5.999240705),
    "leblanc": (IdealGas(5 / 3), (1, 0, 0.2 / 3), IdealGas(5 / 3), (1e-3, 0, 2e-10 / 3))
    + (5.155779277e-4, 0.6218386714, 0.05407933535, 0.00399999806),
    "two gammas": (AIR, (1, 0, 1e5), IdealGas(1.2), (0.125, 0, 1e4))
    + (29380.73518, 300.310494, 0.4169123462, 0.2988111005),
    "water-gas": (StiffenedGas(4.4, 6e8), (1000, 0, 1e9), AIR, (50, 0, 1e5))
    + (14190477.21, 482.6104121, 804.4446323, 288.1680626),
    "triple point, bottom": (IdealGas(1.5), (1, 0, 1), AIR, (1, 0, 0.1))
    + (0.5119685345, 0.5172439078, 0.6399737785, 2.852428921),
    "triple point, top": (IdealGas(1.5), (1, 0, 1), IdealGas(1.5), (0.125, 0, 0.1))
    + (0.2992955507, 0.8922594508, 0.4474386615, 0.2496694984),
}


@pytest.mark.parametrize("name", GASES)
def test_star_states_of_gases(name):
    eos_left, left, eos_right, right, *expected = GASES[name]
    solution = solve_riemann(eos_left, left, eos_right, right)
    found = [solution.p, solution.u, solution.rho_left, solution.rho_right]
    assert found == pytest.approx(expected, rel=6e-10, abs=1e-12)
    assert not solution.gap


@pytest.mark.parametrize(
    "eos_left, eos_right, speed, p, u",
    [
        (AL, SS, 2.0, 26.97967, 0.621767),
        (AL, SS, 4.0, 66.12667, 1.290141),
        (AL, AL, 2.0, 18.20457, 1.0),
        (AL, PB, 2.0, 24.85395, 0.709413),
        (SS, PB, 2.0, 43.80328, 1.068685),
    ],
)
def test_metal_impacts(eos_left, eos_right, speed, p, u):
    solution = solve_riemann(eos_left, (eos_left.rho0, speed, 0), eos_right, (eos_right.rho0, 0, 0))
    assert solution.p == pytest.approx(p, abs=6e-6)
    assert solution.u == pytest.approx(u, abs=6e-7)


@pytest.mark.parametrize("name", [*GASES, "tension", "vacuum"])
def test_profile_conserves_mass_and_momentum(name):
    if name == "tension":
        problem = (AL, (2.707, -2, 0), SS, (7.896, 0, 0))
    elif name == "vacuum":
        problem = (AIR, (1, -10, 0.4), AIR, (1, 10, 0.4))
    else:
        problem = GASES[name][:4]
    _, (rho_l, u_l, p_l), _, (rho_r, u_r, p_r) = problem
    solution = solve_riemann(*problem)
    assert solution.gap == (name == "vacuum")
    speeds, t = solution.get_speeds(), 0.7
    reach = speeds[-1] - speeds[0]
    x = 0.3 + t * np.linspace(speeds[0] - 0.1 * reach, speeds[-1] + 0.2 * reach, 38)
    rho, momentum, _ = compute_cell_averages(solution, x, t, 0.3)
    x_l, x_r = x[0] - 0.3, x[-1] - 0.3
    mass = rho_r * (x_r - u_r * t) - rho_l * (x_l - u_l * t)
    push = t * (rho_r * u_r**2 + p_r - rho_l * u_l**2 - p_l)
    impulse = rho_r * u_r * x_r - rho_l * u_l * x_l - push
    scale = rho_l + rho_r
    assert np.sum(rho * np.diff(x)) == pytest.approx(mass, abs=1e-11 * scale * t * reach)
    assert np.sum(momentum * np.diff(x)) == pytest.approx(impulse, abs=1e-11 * scale * t * reach**2)


def test_vacuum_front_of_an_ideal_gas():
    solution = solve_riemann(AIR, (1, -10, 0.4), AIR, (1, 10, 0.4))
    front = 10 - 2 * math.sqrt(1.4 * 0.4) / 0.4
    assert solution.u_right == pytest.approx(front, rel=1e-14)
    rho, u, p = solution.sample(np.array([0.0, 20.0]))
    assert rho.tolist() == [0.0, 1.0] and u.tolist() == [0.0, 10.0] and p.tolist() == [0.0, 0.4]


def test_condensed_materials_part_at_a_cavitation_pressure():
    states = (AL, (2.707, -2, 1.0), SS, (7.896, 0, 0))
    assert solve_riemann(*states).p < 0.0
    parted = solve_riemann(*states, cavitation_pressure=0.0)
    assert parted.gap and parted.p == 0.0 and parted.u_left < parted.u_right == 0.0
    with pytest.raises(BadInput, match="cavitation"):
        solve_riemann(AL, (2.707, -20, 0), SS, (7.896, 20, 0))
