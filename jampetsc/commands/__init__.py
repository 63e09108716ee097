"""The commands of the program, one module and one class of jobs each. `JOBS` is the table of their names.

A job joins by one line here: command, python function, table of studies and documentation follow from its class.
"""

import functools
import importlib

JOBS = {
    "pack": "pack:Pack",
    "import": "importing:Import",
    "springs": "springs:Springs",
    "export": "export:Export",
    "matrices": "matrices:Matrices",
    "merge": "merge:Merge",
    "info": "info:Info",
    "collapse": "collapse:Collapse",
    "scaling": "scaling:Scaling",
    "sweep": "sweep:Sweep",
    "quasistatic": "quasistatic:Quasistatic",
    "modes": "modes:Modes",
    "oscillate": "oscillate:Oscillate",
    "relax": "relax:Relax",
    "flow": "flow:Flow",
    "shear": "shear:Shear",
    "jam": "jam:Jam",
    "spectrum": "spectrum:Spectrum",
    "correlate": "correlate:Correlate",
    "plot": "plot:Plot",
    "study": "jampetsc.studies.study_job:Study",
    "trade": "jampetsc.studies.trade_job:Trade",
    "examples": "examples:Examples",
}


def job_class(name):
    """The class of the jobs of this name."""
    module, _, job = JOBS[name].partition(":")
    return getattr(importlib.import_module(module if "." in module else f"{__name__}.{module}"), job)


@functools.cache
def study_inputs():
    """{name: its `STUDY_INPUTS`} of the jobs that a study runs, each after the jobs whose results it reads."""
    declared = {name: job_class(name).STUDY_INPUTS for name in JOBS}
    return {name: inputs for name, inputs in declared.items() if inputs is not None}
