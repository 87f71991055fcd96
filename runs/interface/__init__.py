"""What a person calls from Python: `import shockgrid as sg`, `sg.load`, `sg.run`, `sg.open`, ...

May import: everything below the command line.
"""
