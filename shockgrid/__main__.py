"""`python -m shockgrid`: the command line without the installed script."""

import sys

from shockgrid.command import main

sys.exit(main())
