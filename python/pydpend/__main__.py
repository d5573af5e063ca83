"""``python -m pydpend`` is the program ``pydpend``."""

import sys

from pydpend.cli import main

sys.exit(main())
