"""`python -m otwarp`: the command line."""

import sys

from otwarp.cli.start import start

if __name__ == "__main__":
    sys.exit(start())
