"""python -m jampetsc"""

import sys

from jampetsc.cli.main import main

sys.exit(main())
