"""Heat spreading through two blocks side by side: a problem small enough to test the runner on.

The grid sways, dt adapts, and a number is drawn every step, so that a restart that forgets
anything shows in the last bits.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np
from msgspec import Meta

from shockgrid.problems.deck import Deck, DeckTable, RunControl
from shockgrid.problems.problem import Problem
from shockgrid.regrid.errors import BadInput, RunFailure


class Hot(DeckTable, kw_only=True, tag="hot", tag_field="kind"):
    temperature: Annotated[float, Meta(gt=0)] = 2.0


class Cold(DeckTable, kw_only=True, tag="cold", tag_field="kind"):
    chill: Annotated[float, Meta(ge=0)] = 1.0


class Mode(DeckTable, kw_only=True):
    number: Annotated[int, Meta(ge=1)] = 1
    amplitude: float = 0.1


class ToyDeck(Deck, kw_only=True):
    runtime = ("fail_at", "pause", "holds")

    run: RunControl = msgspec.field(default_factory=lambda: RunControl(t_end=0.5, cfl=0.75))
    cells: Annotated[int, Meta(ge=2, le=400, description="cells per side")] = 8
    density: Annotated[float, Meta(gt=0)] = 1.0
    shape: Literal["flat", "wavy"] = "wavy"
    start: Hot | Cold = msgspec.field(default_factory=Hot)
    modes: list[Mode] = msgspec.field(default_factory=list)
    fail_at: int = -1
    pause: Annotated[float, Meta(ge=0)] = 0.0
    holds: list[int] = msgspec.field(default_factory=list)


def hold(step: int) -> None:
    """Touch a file `held-STEP`, and wait for `go-STEP`."""
    Path(f"held-{step}").touch()
    while not Path(f"go-{step}").exists():
        time.sleep(0.002)


class ToyBlock:
    def __init__(self, name: str, nodes: np.ndarray, heat: np.ndarray):
        self.name = name
        self.material = f"stuff {name}"
        self.nodes = nodes
        self.heat = heat
        self.units = {"rho": "kg/m3", "u_node": "m/s", "q": "1"}

    @property
    def cell_fields(self):
        return {"rho": self.heat, "q": 10.0 ** (3 * self.heat)}

    @property
    def node_fields(self):
        return {"u_node": 0.1 * self.nodes[1], "v_node": 0 * self.nodes[0]}


class ToyEvolution:
    def __init__(self, deck: ToyDeck):
        n = deck.cells
        self.deck = deck
        self.t = 0.0
        self.step = 0
        self.t_end = deck.run.t_end or 0.5
        self.blocks = []
        self.random = np.random.default_rng(3)
        for k, name in enumerate(("left", "right")):
            x, y = np.meshgrid(
                np.linspace(k, k + 1, n + 1), np.linspace(0, 1, n + 1), indexing="ij"
            )
            heat = np.full((n, n), 1.0 + (k == 0) * getattr(deck.start, "temperature", 1.0))
            self.blocks.append(ToyBlock(name, np.array([x, y]), heat))

    @property
    def finished(self):
        return "t_end reached" if self.t >= self.t_end else None

    def _total(self):
        return float(sum(block.heat.sum() for block in self.blocks))

    def start_row(self):
        return {"total_heat": self._total()}

    def advance(self):
        if self.step == self.deck.fail_at:
            raise RunFailure(f"block 'left', cell (1, 2), t = {self.t:.3g} s: density -1")
        time.sleep(self.deck.pause)
        if self.step in self.deck.holds:
            hold(self.step)
        left, right = (block.heat for block in self.blocks)
        dt = 0.01 * (1 + 0.1 * self.random.random()) / float(left.max()) ** 0.5
        limit = "diffusion"
        if self.t + dt >= self.t_end:
            dt = self.t_end - self.t
            limit = "end"
        whole = np.concatenate([left, right])
        flow = 10 * dt * np.diff(whole, axis=0)
        whole[:-1] += flow
        whole[1:] -= flow
        left[:], right[:] = np.split(whole, 2)
        self.t = self.t_end if limit == "end" else self.t + dt
        self.step += 1
        for k, block in enumerate(self.blocks):
            x0 = np.linspace(k, k + 1, left.shape[0] + 1)[:, None]
            sway = 0.1 * np.sin(self.t * 6) * np.sin(np.pi * block.nodes[1]) * (x0 * (2 - x0))
            block.nodes[0] = x0 + (self.deck.shape == "wavy") * sway
        return {
            "t": self.t,
            "dt": dt,
            "dt_limit": limit,
            "total_heat": self._total(),
            "least_scaled_jacobian": 0.9,
            "regrid_iterations": 1,
            "seconds_flow": 1e-6,
        }

    def get_state(self):
        state = {f"{b.name}/{k}": getattr(b, k) for b in self.blocks for k in ("nodes", "heat")}
        inner = self.random.bit_generator.state["state"]
        return state | {
            "t": self.t,
            "step": self.step,
            "random": f"{inner['state']} {inner['inc']}",
        }

    def set_state(self, state):
        for block in self.blocks:
            block.nodes[:] = state[f"{block.name}/nodes"]
            block.heat[:] = state[f"{block.name}/heat"]
        self.t = state["t"]
        self.step = state["step"]
        whole = self.random.bit_generator.state
        value, increment = state["random"].split()
        whole["state"] = {"state": int(value), "inc": int(increment)}
        self.random.bit_generator.state = whole


class Toy(Problem):
    Deck = ToyDeck

    def __init__(self, deck):
        super().__init__(deck)
        if deck.cells % 2 and deck.shape == "wavy":
            raise BadInput(
                f"cells = {deck.cells} and shape 'wavy' do not go together; take it even"
            )

    def build(self):
        return ToyEvolution(self.deck)

    def measure(self, evolution):
        return {"hottest": float(evolution.blocks[0].heat.max())}

    def summary(self, history, final):
        return f"hottest at the end: {history['hottest'][-1]:.4f}, theory 1.5"

    def cautions(self, run):
        if self.deck.density <= 10.0:
            return []
        told = [f"density {self.deck.density:g} was never tried; take 10 or less"]
        return told + (["it was hot"] if run.begun else [])

    def figures(self):
        return {"cooling": draw_cooling}


def draw_cooling(figure, run_data):
    axes = figure.subplots()
    axes.plot(run_data.history["t"], run_data.history["hottest"])


def register():
    """Put the toy into the registry of this process."""
    from shockgrid.problems.registry import PROBLEMS

    PROBLEMS["toy"] = "toy_problem:Toy"


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
    from shockgrid.runs.cli.main import main

    register()
    sys.exit(main())
