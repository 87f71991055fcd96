"""Axes that follow a fluid: known digits, equal products, stagnant fluid, bounds, averages."""

import numpy as np
import pytest

from hydro.convection import tensor_grids
from hydro.convection.tensor_grids import correct_axis, make_axis
from regrid.errors import BadInput


def sine(x):
    return np.sin(np.pi * x)


def half_stagnant(x):
    return np.where(x < 0.5, np.sin(2.0 * np.pi * x), 0.0)


def settle(kind, x, profile, corrections=400, **options):
    """Corrections by a profile that is known everywhere, until nothing moves."""
    for _ in range(corrections):
        old = x
        x = correct_axis(kind, x, profile(x), **options)
        if np.abs(x - old).max() < 1e-14 * (x[-1] - x[0]):
            break
    return x


def spread(products):
    return np.ptp(products) / products.mean()


@pytest.mark.parametrize(("n", "first"), [(10, 0.207546), (20, 0.144625), (40, 0.101477)])
def test_polevikov_digits(n, first):
    solved = make_axis("polevikov", n, profile=sine)
    corrected = settle("polevikov", make_axis("polevikov", n), sine)
    for x in (solved, corrected):
        assert x[1] == pytest.approx(first, abs=5.1e-7)
        assert spread(tensor_grids.compute_grid_reynolds(x, sine(x))) < 1e-12
        assert np.allclose(x, 1.0 - x[::-1], atol=1e-12)


@pytest.mark.parametrize("relaxation", [1.0, 0.7, 0.4])
def test_linear_speed_is_exact(relaxation):
    """v = 1 + 10 x: x(q) = (sqrt(1 + 120 q) - 1) / 10, exact for the discrete equations."""
    exact = (np.sqrt(1.0 + 120.0 * np.linspace(0.0, 1.0, 21)) - 1.0) / 10.0
    x = settle("polevikov", make_axis("uniform", 20), lambda x: 1 + 10 * x, relaxation=relaxation)
    assert np.abs(x - exact).max() < 1e-12
    weights = make_axis("monitor", 20, profile=lambda x: 1 + 10 * x)
    assert np.abs(weights - exact).max() < 1e-12


def test_one_correction_is_the_papers_tridiagonal_system():
    x = make_axis("clustered", 12, -1.0, 3.0, walls="low")
    size = np.abs(np.cos(x) + 0.3 * x)
    new = correct_axis("polevikov", x, size, ratio=np.inf)
    left, right = size[:-2] + size[1:-1], size[1:-1] + size[2:]
    residual = left * new[:-2] - (left + right) * new[1:-1] + right * new[2:]
    assert np.abs(residual).max() < 1e-12 and new[0] == -1.0 and new[-1] == 3.0


def test_wall_step_falls_as_the_root_of_n():
    """What the paper's weight cannot do: four times the nodes halve the step at the wall only."""
    first = [make_axis("polevikov", n, profile=sine)[1] for n in (80, 320)]
    assert first[0] / first[1] == pytest.approx(2.0, rel=0.01)


@pytest.mark.parametrize("n", [20, 80])
@pytest.mark.parametrize("kind", ["polevikov", "monitor", "combined"])
def test_stagnant_fluid(kind, n):
    """Corrections settle, steps in fluid at rest are equal away from its edge, none degenerates."""

    def profile(x):
        return (half_stagnant(x), half_stagnant(x)) if kind == "combined" else half_stagnant(x)

    x = settle(kind, make_axis(kind, n), profile)
    again = correct_axis(kind, x, profile(x))
    assert np.abs(again - x).max() < 1e-10
    steps = np.diff(x)
    assert (
        steps.min() > 0.1 / n
        and tensor_grids.compute_neighbour_ratio(x) <= tensor_grids.RATIOS[kind] + 1e-9
    )
    assert np.abs(x[x < 0.5]).size > 0.55 * n
    wide = make_axis(kind, 4 * n)
    still = settle(kind, wide, profile, floor=0.1)
    rest = np.diff(still)[-2:]
    assert rest[0] == pytest.approx(rest[1], rel=1e-9)


def test_fluid_at_rest_has_a_uniform_axis():
    x = make_axis("clustered", 16, clustering=3.0)
    for kind in ("polevikov", "monitor", "combined"):
        zero = (0.0 * x, 0.0 * x) if kind == "combined" else 0.0 * x
        assert spread(np.diff(correct_axis(kind, x, zero))) < 1e-12


@pytest.mark.parametrize("ratio", [1.05, 1.2])
@pytest.mark.parametrize("kind", ["polevikov", "monitor", "combined"])
def test_bound_on_neighbours_is_kept(kind, ratio):
    def layer(x):
        return np.tanh(30.0 * (x - 0.3)) * np.sin(np.pi * x)

    x = make_axis(kind, 40)
    for _ in range(25):
        profile = (layer(x), layer(x)) if kind == "combined" else layer(x)
        x = correct_axis(kind, x, profile, ratio=ratio, strength=4.0, relaxation=0.7)
        assert tensor_grids.compute_neighbour_ratio(x) <= ratio * (1.0 + 1e-9)
        assert x[0] == 0.0 and x[-1] == 1.0
    free = settle(
        kind,
        x,
        lambda x: (layer(x), layer(x)) if kind == "combined" else layer(x),
        corrections=25,
        ratio=np.inf,
        strength=4.0,
    )
    assert tensor_grids.compute_neighbour_ratio(free) > ratio, "the bound had nothing to do"


def test_monitor_equidistributes_arc_and_puts_half_the_nodes_into_a_layer():
    def layer(x):
        return np.tanh(200.0 * (x - 0.5))

    x = settle("monitor", make_axis("monitor", 60), layer, ratio=np.inf, relaxation=0.7)
    size = np.abs(np.diff(layer(x)) / np.diff(x))
    weight = 1.0 + size / (size @ np.diff(x))
    assert spread(weight * np.diff(x)) < 1e-10
    assert np.count_nonzero(np.abs(x - 0.5) < 0.02) == pytest.approx(30, abs=3)


def test_combined_ends_are_its_parts():
    x = make_axis("clustered", 30)
    both = (sine(x), np.exp(3.0 * x))
    alone = correct_axis("monitor", x, both[1])
    assert np.array_equal(correct_axis("combined", x, both, share=0.0), alone)
    y = settle("combined", x, lambda x: (sine(x), x), share=1.0, ratio=2.5)
    assert spread(tensor_grids.compute_grid_reynolds(y, sine(y))) < 1e-12


def test_clustered_axis():
    for walls in ("both", "low", "high"):
        x = make_axis("clustered", 20, 1.0, 3.0, walls=walls, clustering=2.0)
        steps = np.diff(x)
        assert x[0] == 1.0 and x[-1] == 3.0 and steps.min() > 0.0
        assert (steps[0] < 0.05) == (walls != "high") and (steps[-1] < 0.05) == (walls != "low")
    both = make_axis("clustered", 20)
    assert np.allclose(both + both[::-1], 1.0, atol=1e-15)


def test_averages_of_a_tensor_field():
    """v1 = sin(pi x) cos(pi y), v2 = -cos(pi x) sin(pi y): ubar = 1/sqrt(2), and so is vbar."""
    x, y = make_axis("clustered", 30), make_axis("uniform", 40, 0.0, 1.0)
    across, up = np.meshgrid(x, y, indexing="ij")
    u = np.sin(np.pi * across) * np.cos(np.pi * up)
    v = -np.cos(np.pi * across) * np.sin(np.pi * up)
    ubar, vbar = tensor_grids.compute_speed_averages(x, y, u, v)
    assert ubar.shape == (31,) and vbar.shape == (41,)
    assert np.abs(ubar**2 - 0.5).max() < 1e-12  # the rule is exact for these on equal steps
    assert np.abs(vbar**2 - 0.5).max() < 2e-3
    by_x, by_y = tensor_grids.compute_gradient_averages(x, y, 2.0 * across - 3.0 * up)
    assert np.allclose(by_x, 2.0) and np.allclose(by_y, 3.0) and by_x.shape == (30,)


@pytest.mark.parametrize("kind", tensor_grids.KINDS)
def test_tensor_grid_is_two_axes(kind):
    """A field of x alone moves the nodes of x as the axis on its own, and those of y not at all."""
    x, y = make_axis("uniform", 24), make_axis("uniform", 16, 0.0, 2.0)
    speed = np.repeat(sine(x)[:, None], y.size, axis=1)
    field = np.repeat(np.exp(2.0 * x)[:, None], y.size, axis=1)
    new_x, new_y = tensor_grids.correct_tensor_grid(kind, x, y, 0.0 * speed, speed, field)
    profile = {"monitor": np.exp(2.0 * x), "combined": (sine(x), np.exp(2.0 * x))}
    assert np.allclose(new_x, correct_axis(kind, x, profile.get(kind, sine(x))), atol=1e-13)
    assert np.allclose(new_y, y, atol=1e-12)


def test_bad_input_is_named():
    x = make_axis("uniform", 8)
    cases = (
        (lambda: make_axis("uniform", 2), "2 cells"),
        (lambda: make_axis("polevikof", 8), "did you mean 'polevikov'"),
        (lambda: make_axis("uniform", 8, 1.0, 0.0), "no length"),
        (lambda: make_axis("clustered", 8, walls="left"), "walls"),
        (lambda: make_axis("clustered", 8, clustering=-1.0), "clustering"),
        (lambda: make_axis("clustered", 8, clustering=20.0), "lost in round-off"),
        (lambda: correct_axis("polevikov", x, x[:-1]), "9 finite values"),
        (lambda: correct_axis("polevikov", x, x * np.nan), "not finite"),
        (lambda: correct_axis("polevikov", x[::-1], x), "increase"),
        (lambda: correct_axis("polevikov", x, x, floor=0.0), "floor"),
        (lambda: correct_axis("monitor", x, x, ratio=1.0), "ratio"),
        (lambda: correct_axis("monitor", x, x, relaxation=0.0), "relaxation"),
        (lambda: correct_axis("monitor", x, x, strength=-1.0), "strength"),
        (lambda: correct_axis("monitor", x, np.full(8, np.inf)), "not finite"),
        (lambda: correct_axis("combined", x, x), r"\(speed, field\)"),
        (lambda: correct_axis("combined", x, (x, x), share=2.0), "share"),
        (lambda: tensor_grids.compute_speed_averages(x, x, x, x), "shape"),
        (lambda: tensor_grids.correct_tensor_grid("monitor", x, x, 0, 0), "none was given"),
    )
    for call, words in cases:
        with pytest.raises(BadInput, match=words):
            call()
