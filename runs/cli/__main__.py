"""`python -m runs.cli`: the command line without the installed script."""

import sys

from runs.cli.main import main

sys.exit(main())
