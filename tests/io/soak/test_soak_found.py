"""What endurance runs found, each mended: it stays so."""

from __future__ import annotations

import warnings

import numpy as np
from toy_problem import Toy

from problems.plate_on_wedge.report import reduce_known
from regrid.errors import RunFailure


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


def test_a_theory_that_cannot_be_computed_ends_no_run(shockgrid, monkeypatch):
    def fail(self, history, final=None):
        raise RunFailure("linear growth: the solution left the range of numbers")

    monkeypatch.setattr(Toy, "summary", fail)
    monkeypatch.setattr(Toy, "cautions", lambda self, history=None: fail(self, history))
    code, text, error = shockgrid("run", "toy", "-q", "-o", "run", "--set", "run.t_end=0.1")
    assert code == 0 and "t_end reached" in text, error
    assert "no comparison with theory: linear growth: the solution left" in text
    code, text, error = shockgrid("info", "run")
    assert code == 0 and "how far to trust this is not known" in text, error
