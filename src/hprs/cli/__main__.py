"""Runs the command line: `python -m hprs.cli`."""

import sys

from hprs.cli import main

sys.exit(main())
