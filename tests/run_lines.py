"""Command lines of a list, one after another in this process, and pieces of python: JSON from the standard input.

A list is the words of a command after `jampetsc`, a string is python, {"folder": path} goes there and forgets the names
of the python before. Ends at the first that fails, which it names.
"""

import gc
import json
import os
import sys

from jampetsc import main as cli

names, commands = {}, set()
gc.set_threshold(10_000)  # objects until garbage is looked for, as in conftest.py
for item in json.load(sys.stdin):
    if "jampetsc.plots.style" in sys.modules:  # pictures are drawn, at a third of the dots
        sys.modules["jampetsc.plots.style"].STYLE.update(dict.fromkeys(("figure.dpi", "savefig.dpi"), 100))
    if "jampetsc.plots.sphere_drawing" in sys.modules:
        sys.modules["jampetsc.plots.sphere_drawing"].VIEW_PIXELS = 400
    if isinstance(item, dict):
        os.chdir(item["folder"])
        names = {}
        print(f"in {item['folder']}", file=sys.stderr)
    elif isinstance(item, str):
        exec(item, names)
    elif cli.main(item):
        sys.exit(f"failed: jampetsc {' '.join(item)}")
    elif item[0] not in commands:
        commands.add(item[0])
        gc.freeze()  # what it has imported, through which every study would go to find garbage
