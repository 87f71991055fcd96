"""Readers that are not ours: tests that need them say which are lacking."""

import importlib.util

import pytest


def missing(*names: str):
    """Mark that skips a test where one of the modules is not installed."""
    lacking = [name for name in names if importlib.util.find_spec(name) is None]
    return pytest.mark.skipif(bool(lacking), reason=f"not installed: {', '.join(lacking)}")
