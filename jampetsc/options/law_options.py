"""The damping law of a job: the options that make one, from the table of families."""

from dataclasses import dataclass

from jampetsc.laws.damping import (
    CUSTOM,
    DEFAULT,
    FAMILIES,
    OPTIONS,
    WEIGHTS,
    Law,
    Physics,
    damping_law,
    having,
    python_text,
)
from jampetsc.options.job import Job
from jampetsc.options.parameters import (
    FILE,
    NUMBER,
    SWITCH,
    WORD,
    CompositeParameter,
    Parameter,
    composite_parameter,
    parameter,
)
from jampetsc.options.values import PACKING, PACKING_OR_NETWORK
from jampetsc.packing.packing import Packing

GROUP = "damping law"


def law_parameters(default):
    """The parameters of a damping law; `default`: the family if none is given, or None."""
    labels = " or ".join(f"{family.label} ({name})" for name, family in FAMILIES.items())
    declared = [Parameter("law", labels, WORD, default, choices=tuple(FAMILIES), group=GROUP)]
    for name in OPTIONS:
        owners = having(name)
        option = FAMILIES[owners[0]].options[name]
        if isinstance(option.default, bool):
            off = f"{option.meaning} (law {' or '.join(owners)})"
            declared.append(Parameter(name, f"unless {off}", SWITCH, True, off=off, group=GROUP))
        else:
            help = f"{option.meaning} ({_belonging(name, owners)})"
            declared.append(Parameter(name, help, NUMBER, None, metavar=name.upper(), group=GROUP))
    declared.append(Parameter("tau1", "damping time τ₁", NUMBER, 1.0, above=0.0, metavar="TIME", group=GROUP))
    return tuple(declared)


def _belonging(name, owners):
    defaults = {owner: FAMILIES[owner].options[name].default for owner in owners}
    if len(set(defaults.values())) == 1:
        return f"law {' or '.join(owners)}, default {defaults[owners[0]]:g}"
    return "; ".join(f"law {owner}, default {default:g}" for owner, default in defaults.items())


def law_options(law: Law) -> dict:
    """{name: value} of the options that describe a law, without defaults; python text where no options do."""
    if law.family:
        defaults = {name: option.default for name, option in FAMILIES[law.family].options.items()}
        changed = {name: value for name, value in law.options if value != defaults[name]}
        return {"law": law.family, "tau1": law.tau1, **changed}
    if law.exponent != 1.0:
        return {"law": repr(law), "tau1": law.tau1}
    return {"law": CUSTOM, "tau1": law.tau1} | {
        name: value for name in WEIGHTS if (value := getattr(law, name))
    }


def law_code(**options) -> str:
    """Python text of the law that these options describe."""
    families = [name for name, family in FAMILIES.items() if {*options} <= {"tau1", *family.options}]
    return f"jampetsc.{python_text((families or [DEFAULT])[0], options)}"


LAW_IN_PYTHON = " or ".join(
    [
        ", ".join("jampetsc." + family.python.format("…") for family in FAMILIES.values()),
        ", ".join(f'"{name}"' for name in FAMILIES),
    ]
)
DAMPING = CompositeParameter(
    law_parameters(DEFAULT), damping_law, law_options, Law, "damping law", LAW_IN_PYTHON, law_code
)
PRESTRESS = parameter(
    True,
    "K keeps the f/r term of its contacts (BT: 'with pre-stress')",
    off="drop the f/r term of K (BT: 'without pre-stress')",
)


@dataclass(frozen=True, eq=False)
class PackingJob(Job):
    """Base of jobs on the matrices of a packing, under a damping law."""

    packing: Packing = parameter(help="packing", value_type=PACKING, place=FILE)
    law: Law = composite_parameter(DAMPING)
    prestress: bool = PRESTRESS

    @property
    def physics(self) -> Physics:
        """Law and pre-stress."""
        return Physics(self.law, self.prestress)


@dataclass(frozen=True, eq=False)
class NetworkJob(PackingJob):
    """Base of jobs on the matrices of a packing or a network of springs."""

    packing: Packing = parameter(help="packing or network", value_type=PACKING_OR_NETWORK, place=FILE)
