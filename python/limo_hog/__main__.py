"""`python -m limo_hog`: the command line, where its script is not on the path."""

from __future__ import annotations

import sys

from limo_hog.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
