"""`python -m hprs`: the command line where its script is not on the path."""

from hprs.cli import main

raise SystemExit(main())
