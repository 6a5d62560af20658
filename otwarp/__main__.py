"""`python -m otwarp`: the command line."""

import sys

from otwarp.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
