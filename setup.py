"""The packages: folders at the top of the repository are installed inside `shockgrid`."""

from setuptools import find_packages, setup

INSIDE = ("regrid", "hydro", "problems", "runs")

setup(
    package_dir={f"shockgrid.{name}": name for name in INSIDE},
    packages=[
        "shockgrid",
        *(f"shockgrid.{name}" for name in find_packages(include=[f"{one}*" for one in INSIDE])),
    ],
)
