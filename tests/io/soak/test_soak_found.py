"""What endurance runs found, each mended: it stays so."""

from __future__ import annotations

import warnings

import numpy as np

from problems.plate_on_wedge.report import reduce_known


def test_a_regridder_named_twice_is_one_sentence(shockgrid, toy):
    (toy / "deck.toml").write_text(
        'problem = "interface-instability"\n[regrid.options]\nname = "barrier"\n'
    )
    code, _, error = shockgrid("check", "deck.toml")
    assert code == 2 and "regrid.name" in error and len(error.splitlines()) == 1


def test_angles_that_are_never_known_are_no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.isnan(reduce_known(np.nanmean, np.full(3, np.nan)))
        assert np.isnan(reduce_known(np.nanmax, np.empty(0)))
        assert reduce_known(np.nanmean, np.array([1.0, np.nan, 4.0])) == 2.5
