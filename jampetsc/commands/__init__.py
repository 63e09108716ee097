"""Jobs: what can be asked of the program, one module each. `JOBS` is the table of their names.

A job joins by one line here: command, python function, table of studies and documentation follow from its class.
"""

import importlib

JOBS = {
    "pack": "pack:Pack",
    "import": "importing:Import",
    "export": "export:Export",
    "matrices": "matrices:Matrices",
    "merge": "merge:Merge",
    "info": "info:Info",
    "collapse": "collapse:Collapse",
    "sweep": "sweep:Sweep",
    "quasistatic": "quasistatic:Quasistatic",
    "flow": "flow:Flow",
    "shear": "shear:Shear",
    "jam": "jam:Jam",
    "modes": "modes:Modes",
    "oscillate": "oscillate:Oscillate",
    "spectrum": "spectrum:Spectrum",
    "correlate": "correlate:Correlate",
    "plot": "plot:Plot",
    "study": "jampetsc.studies.job:Study",
    "trade": "jampetsc.speed_accuracy.job:Trade",
    "examples": "examples:Examples",
}


def job_class(name):
    """The class of the jobs of this name."""
    module, _, job = JOBS[name].partition(":")
    return getattr(importlib.import_module(module if "." in module else f"{__name__}.{module}"), job)
