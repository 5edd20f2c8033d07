"""Runs the command line: `python -m env2mjcf`."""

import sys

from .cli.main import main

if __name__ == "__main__":
    sys.exit(main())
