"""What documents and help write as command lines and studies, at sizes for tests."""

import re
from itertools import pairwise

SHEARED = ("flow", "shear", "jam")
SIZES = {  # option, or command and option -> its value here, or {its value: that here}
    "--n": {"64": "16", "256": "24", "512": "32", "1024": "32"},
    **{"--count": "5", "--seeds": "1:2", "--snapshots": "4", "--below": "0.5"},
    **{"--discard": "0.01", "--cooling-rate": "0.5"},
    **{(command, "--strain"): "0.05" for command in SHEARED},
    **{("flow", "--phi"): "0.86", ("shear", "--phi"): "0.86"},
    # each point of an oscillation takes a while
    **{("oscillate", "--omega"): "1e-6", ("oscillate", "--strain"): "1e-6", ("oscillate", "--steps"): "32"},
    **{("moving", "--omega"): "1e-2", ("moving", "--strain"): "1e-4"},
    ("--events", "--strain"): {"0.01": "0.01", "-0.01": "-0.01"},  # small packings come apart later
    # a relaxation takes a second or more
    **{("relax", "--strain"): "1e-6", ("relax", "--times"): "0.1,1", ("relax", "--accuracy"): "1e-2"},
    ("oscillate", "--stress"): {"1e-6,1e-5": "1e-5", "1e-5,1e-4": "1e-4"},
}


def small(words):
    """A command line at a size for tests."""
    command = next((word for word in ("moving", "--events") if word in words), words[0])
    made = [words[0]]
    for option, word in pairwise(words):
        here = SIZES.get((command, option)) or SIZES.get((words[0], option)) or SIZES.get(option, word)
        made.append(_few_points(here.get(word, word) if isinstance(here, dict) else here))
    if words[0] == "pack" and "--stabilise" not in words:
        made += ["--stabilise", "shear"]  # at so small sizes the shear modulus would often be negative
    if words[0] == "relax" and "--times" not in words:
        made += ["--times", "0.1,1"]
    if words[0] == "oscillate":
        made += [] if "--steps" in words else ["--steps", "16"]
        made += ["--cycles", "3"] if "moving" in words else []
    return made


def _few_points(text):
    """Samples of particles that are pushed, at a size for tests."""
    return re.sub(r"points:\d+", "points:8", text)


def small_study(text):
    """A study at a size for tests."""
    text = _few_points(text)
    return re.sub(r'"1:\d+"', '"1:2"', re.sub(r"^( *n =) .*", r"\1 16", text, flags=re.MULTILINE))
