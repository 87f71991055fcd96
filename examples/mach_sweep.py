"""Growth of a shocked interface at three Mach numbers: a packaged problem from Python."""

import shockgrid as sg

for mach in (1.2, 1.5, 2.0):
    run = sg.run(
        "interface-instability",
        f"out/mach-{mach}",
        force=True,
        mach=mach,
        cells=16,
        kct_end=6.0,
    )
    growth = run.history["amplitude"][-1] / run.history["amplitude"][0]
    print(f"Mach {mach}: the amplitude has grown to {growth:.2f} of its first value")
    assert growth > 1.0
