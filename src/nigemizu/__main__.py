"""``python -m nigemizu`` is the command ``nigemizu``."""

import sys

from nigemizu.cli import main

if __name__ == "__main__":
    sys.exit(main())
