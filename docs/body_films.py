"""Makes docs/pictures/body-*.gif: films of a hammer, of jaws and of three discs.

python docs/body_films.py DIR    # the decks and runs go into DIR; some minutes
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from PIL import Image, ImageSequence

PICTURES = Path(__file__).resolve().parent / "pictures"
WIDTH = 400  # pixels
COLOURS = 32
FRAME_TIME = 350  # ms
SIDES = "i_min", "i_max", "j_min", "j_max"


def make_line(start, end):
    """A straight curve between two points [mm]."""
    return str([[1e-3 * coordinate for coordinate in point] for point in (start, end)])


def make_arc(middle, radius, start, end):
    """A curve on a circle [mm], between two angles in half turns."""
    angle = f"pi*({start} + {end - start}*s)"
    return (
        f'{{ x = "1e-3*({middle[0]} + {radius}*cos({angle}))", '
        f'y = "1e-3*({middle[1]} + {radius}*sin({angle}))" }}'
    )


def make_block(name, material, curves, cells, u=0.0, v=0.0):
    """A body of one block with free surfaces on all sides; curves in the order of SIDES."""
    sides = ", ".join(f'{{ side = "{side}", kind = "free-surface" }}' for side in SIDES)
    lines = [f"curves.{side} = {curve}" for side, curve in zip(SIDES, curves, strict=True)]
    return "\n".join(
        [
            "[[block]]",
            f'name = "{name}"',
            f'material = "{material}"',
            f"p = 0.0\nu = {u}\nv = {v}\ncells = {list(cells)}",
            f"side = [{sides}]",
            *lines,
            "",
        ]
    )


def make_box(name, material, low, high, cells, **speeds):
    corners = low, (high[0], low[1]), high, (low[0], high[1])
    edges = (0, 3), (1, 2), (0, 1), (3, 2)
    curves = [make_line(corners[start], corners[end]) for start, end in edges]
    return make_block(name, material, curves, cells, **speeds)


def make_disc(name, material, middle, radius, cells, **speeds):
    quarters = (1.25, 0.75), (-0.25, 0.25), (-0.75, -0.25), (0.75, 0.25)
    curves = [make_arc(middle, radius, *quarter) for quarter in quarters]
    return make_block(name, material, curves, (cells, cells), **speeds)


def make_strip(name, material, radii, cells):
    """A ring of 300 degrees, open on the left."""
    ends = 5.0 / 6.0, -5.0 / 6.0
    cosine, sine = -(3.0**0.5) / 2.0, 0.5
    first = make_line(*[(radius * cosine, radius * sine) for radius in radii])
    last = make_line(*[(radius * cosine, -radius * sine) for radius in radii])
    arcs = [make_arc((0.0, 0.0), radius, *ends) for radius in radii]
    return make_block(name, material, [first, last, *arcs], cells)


def make_three_discs():
    discs = []
    for name, material, x, y in (
        ("a", "Al1100", 0.0, 1.0),
        ("b", "copper", -(3.0**0.5) / 2.0, -0.5),
        ("c", "SS304", 3.0**0.5 / 2.0, -0.5),
    ):
        middle = 1.25 * x, 1.25 * y
        discs.append(make_disc(name, material, middle, 1.0, 20, u=-400.0 * x, v=-400.0 * y))
    return discs


# of each film: its bodies, the end [us], the field
FILMS = {
    "hammer": (
        [
            make_box("anvil", "tungsten", (-2.0, -1.0), (2.0, 0.0), (40, 10)),
            make_box("work", "lead", (-0.5, 0.01), (0.5, 0.61), (20, 12)),
            make_box("hammer", "tungsten", (-1.5, 0.63), (1.5, 1.63), (30, 10), v=-300.0),
        ],
        2.1,
        "v",
    ),
    "jaws": (
        [
            make_strip("strip", "copper", (1.0, 1.4), (80, 8)),
            make_disc("ball", "Al1100", (-1.45, 0.0), 0.42, 16, u=800.0),
        ],
        3.0,
        "u",
    ),
    "three-discs": (make_three_discs(), 2.5, "v"),
}


def shrink(film: Path, target: Path) -> None:
    """Write every second frame of a film, smaller and in one palette of few colours."""
    pictures = [frame.convert("RGB") for frame in ImageSequence.Iterator(Image.open(film))]
    small = []
    for picture in pictures[::2]:
        height = round(picture.height * WIDTH / picture.width)
        small.append(picture.resize((WIDTH, height), Image.Resampling.LANCZOS))
    # one palette for all, else the scale beside the picture changes from frame to frame
    sheet = Image.new("RGB", (WIDTH, height * len(small)))
    for number, picture in enumerate(small):
        sheet.paste(picture, (0, number * height))
    palette = sheet.quantize(COLOURS)
    frames = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in small]
    frames[0].save(
        target, save_all=True, append_images=frames[1:], duration=FRAME_TIME, loop=0, optimize=True
    )


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, (bodies, end, field) in FILMS.items():
        deck = folder / f"{name}.toml"
        run = folder / name
        film = folder / f"{name}.gif"
        head = f'problem = "blocks"\nrun.t_end = {end}e-6\noutput.dumps = 24\n\n'
        deck.write_text(head + "\n".join(bodies), encoding="utf-8")
        shockgrid = [sys.executable, "-m", "shockgrid"]
        subprocess.run([*shockgrid, "run", deck, "-o", run, "--force"], check=True)
        drawing = ["film", run, field, "--mesh", "--fps", "8", "-o", film]
        subprocess.run([*shockgrid, *drawing], check=True)
        shrink(film, PICTURES / f"body-{name}.gif")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
