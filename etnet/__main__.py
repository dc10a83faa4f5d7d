"""`python -m etnet COMMAND …`, and what torchrun starts."""

import sys

from etnet.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
