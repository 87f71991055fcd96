"""The Python interface: `import shockgrid as sg`, `sg.load`, `sg.run`, `sg.open`, ...

May import: everything below the command line.
"""
