"""python -m jampetsc"""

import sys

from jampetsc.cli import main

sys.exit(main())
