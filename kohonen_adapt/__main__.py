"""``python -m kohonen_adapt`` is the command ``kohonen-adapt``."""

import sys

from kohonen_adapt.commands.main import main

if __name__ == "__main__":
    sys.exit(main())
