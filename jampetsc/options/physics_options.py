"""Options that make a damping law, the model of a flow or a load, from the tables of `laws/`."""

from dataclasses import dataclass

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.laws import loads
from jampetsc.laws.damping import (
    CUSTOM,
    DEFAULT,
    FAMILIES,
    MAX_WEIGHT,
    OPTIONS,
    WEIGHTS,
    Law,
    Physics,
    damping_law,
    elastic_parameters,
    having,
    python_text,
)
from jampetsc.laws.flow_models import MODELS, Model, model_of
from jampetsc.options.job import Job
from jampetsc.options.parameters import (
    FILE,
    NUMBER,
    SWITCH,
    WORD,
    CompositeParameter,
    Parameter,
    ValueType,
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
    declared.append(
        Parameter(
            "tau1",
            "damping time τ₁, which sets the unit of times",
            NUMBER,
            1.0,
            above=0.0,
            metavar="TIME",
            group=GROUP,
        )
    )
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
        return _with_floats({"law": law.family, "tau1": law.tau1, **changed})
    if law.exponent != 1.0:
        return _with_floats({"law": repr(law), "tau1": law.tau1})
    weights = {name: value for name in WEIGHTS if (value := getattr(law, name))}
    return _with_floats({"law": CUSTOM, "tau1": law.tau1} | weights)


def _with_floats(options) -> dict:
    """Options with numbers as a command line reads them: 2 of python code is 2.0."""
    return {name: float(value) if type(value) is int else value for name, value in options.items()}


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


TANGENTIAL_STIFFNESS = parameter(
    0.0,
    "elastic springs between the rims of touching particles, k_t over the stiffness k of each contact; above 0 "
    "particles roll, and no contact slips",
    low=0.0,
    high=MAX_WEIGHT,
    metavar="RATIO",
)


@dataclass(frozen=True, eq=False)
class PackingJob(Job):
    """Base of jobs on the matrices of a packing, under a damping law."""

    packing: Packing | str = parameter(help="packing", value_type=PACKING, place=FILE)
    law: Law = composite_parameter(DAMPING)
    prestress: bool = PRESTRESS
    tangential_stiffness: float = TANGENTIAL_STIFFNESS

    @property
    def physics(self) -> Physics:
        """Law, pre-stress and tangential springs."""
        return Physics(self.law, self.prestress, self.tangential_stiffness)

    @property
    def elastic(self) -> dict:
        """What K has beside the stiffness of contacts, for `build_network`."""
        return elastic_parameters(self.prestress, self.tangential_stiffness)


@dataclass(frozen=True, eq=False)
class NetworkJob(PackingJob):
    """Base of jobs on the matrices of a packing or a network of springs."""

    packing: Packing | str = parameter(help="packing or network", value_type=PACKING_OR_NETWORK, place=FILE)


MODEL_HELP = (
    "model: drag (RD) or contact damping (CD; CDn normal, CDt tangential only); overdamped where the name ends "
    "in 0"
)
MOTION = {  # parameter -> help, and its range
    "mass": ("mass of every particle, in the unit of k τ₁²", {"above": 0.0, "metavar": "M"}),
    "quality": ("quality factor Q = √(m k)/(k τ₁), instead of a mass", {"above": 0.0, "metavar": "Q"}),
    "background_drag": (
        "drag δ of the fluid beside contact damping, a weight in units of k τ₁ (default: the limit δ → 0)",
        {"low": 0.0, "metavar": "D"},
    ),
}
MODEL_PARAMETERS = (
    Parameter("model", MODEL_HELP, WORD, None, choices=tuple(MODELS), group="model"),
    *(
        Parameter(name, help, NUMBER, None, high=MAX_WEIGHT, group="model", **how)
        for name, (help, how) in MOTION.items()
    ),
)


def build_model(**options) -> Model:
    """The model that these options describe. Raises InputError for a contradiction, and as `Model`."""
    law = {name: value for name, value in options.items() if name in ("law", *OPTIONS)}
    if "model" in options:
        if law:
            raise InputError(
                f"{named('model')} {options['model']}, {named(next(iter(law)))}: both given. Give one of them."
            )
        return model_of(
            options["model"], **{name: value for name, value in options.items() if name != "model"}
        )
    if "law" not in options:
        raise InputError(
            f"{named('model')}: missing. Give one of {', '.join(MODELS)}, or {named('law')} with its options."
        )
    motion = {name: options[name] for name in MOTION if name in options}
    return Model(damping_law(**{name: options[name] for name in options if name not in motion}), **motion)


def model_options(model: Model) -> dict:
    """{name: value} of the options that describe a model."""
    motion = _with_floats({name: getattr(model, name) or None for name in MOTION})
    if model.name:
        return _with_floats({"model": model.name, "tau1": model.law.tau1}) | motion
    return law_options(model.law) | motion


def model_code(**options) -> str:
    """Python text of a model that these options describe."""
    motion = ", ".join(f"{name}={value!r}" for name, value in options.items() if name in MOTION)
    of_law = {name: value for name, value in options.items() if name not in MOTION}
    if not of_law:
        return f"jampetsc.models.CDn({motion})"
    law = "law" if "law" in of_law else law_code(**of_law)
    return f"jampetsc.models.Model({law}, {motion})" if motion else law


MODEL_IN_PYTHON = "jampetsc.models.CDn(mass=…), a damping law, a Model of it or " + ", ".join(
    f'"{name}"' for name in MODELS
)
MODEL = CompositeParameter(
    (*MODEL_PARAMETERS, *law_parameters(None)),
    build_model,
    model_options,
    Model,
    "model of the flow",
    MODEL_IN_PYTHON,
    model_code,
)


LOAD = ValueType(  # see `laws.loads.LoadChoice`
    loads.read_strain, str, metavar="LOAD", python="str, array (D, D) or one of `jampetsc.loads`"
)
LOAD_OR_FORCES = ValueType(
    loads.LoadChoice,
    str,
    metavar="LOAD",
    python="str, array (D, D), one of `jampetsc.loads` or forces (N, D)",
)
LOAD_NAMES = (
    "load, a displacement gradient E: xy or yx (simple shear), pure-xy, compression, xx, yy (in 3D also xz, zz, …), or "
    "D² numbers row by row (with commas; on a command line with = where the first is negative)"
)
LOAD_HELP = LOAD_NAMES + "{}. Moduli are second derivatives of the energy per volume along F = 1 + εE"
FORCES_HELP = (
    "; or forces: wave:1,0:transverse or longitudinal (numbers of cell vectors; several with + between them), point:7 "
    "(particles), points:100 or points:100:5 (a sample, its seed)"
)


def load_parameter(of_tensor: str = "", takes_forces: bool = False):
    """The parameter `load` of a job; of_tensor: what it finds for all symmetric loads, if it takes them."""
    words = f"; {loads.TENSOR}: {of_tensor}" if of_tensor else ""
    if not takes_forces:
        return parameter(loads.DEFAULT, LOAD_HELP.format(words), value_type=LOAD)
    return parameter(loads.DEFAULT, LOAD_HELP.format(words + FORCES_HELP), value_type=LOAD_OR_FORCES)


def check_finite_strain(load: loads.LoadChoice, strain: float, command: str) -> None:
    """Raise InputError for loads that turn the first axis of the cell 1 + γE, and those that leave it no volume."""
    if load.is_tensor:
        raise InputError(
            f"{named('load')} {loads.TENSOR}: not supported, as the response to a finite strain is not linear. Give a "
            f"single {named('load')}."
        )
    for single in load.by_dimension().values():
        E = single.gradient
        if np.tril(E, -1).any():
            raise InputError(
                f"{named('load')} {load}: not supported by {command}, as it turns the axes of the cell. Give a "
                "gradient with zeros below its diagonal, such as xy."
            )
        if not (1.0 + strain * np.diag(E) > 0.0).all():
            raise InputError(
                f"{named('strain')} {strain:g}: leaves the cell no volume under {named('load')} {load}. Give a "
                "smaller one."
            )
