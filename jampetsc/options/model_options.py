"""The model of a flow: the options that make one, a name of `laws.flow_models.MODELS` or a damping law, and a mass."""

from jampetsc.errors import InputError, named
from jampetsc.laws.damping import MAX_WEIGHT, OPTIONS, damping_law
from jampetsc.laws.flow_models import MODELS, Model, model_of
from jampetsc.options.law_options import law_code, law_options, law_parameters
from jampetsc.options.parameters import NUMBER, WORD, CompositeParameter, Parameter

WHAT = "model: drag (RD) or contact damping (CD; CDn normal, CDt tangential only); overdamped where the name ends in 0"
MOTION = {  # parameter -> what it is, and its range
    "mass": ("mass of every disk", {"above": 0.0, "metavar": "M"}),
    "quality": ("quality factor Q = √(m k)/(k τ₁), instead of a mass", {"above": 0.0, "metavar": "Q"}),
    "background_drag": (
        "drag δ of the fluid beside contact damping (default: the limit δ → 0)",
        {"low": 0.0, "metavar": "D"},
    ),
}
OWN = (
    Parameter("model", WHAT, WORD, None, choices=tuple(MODELS), group="model"),
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
                f"{named('model')} {options['model']} and {named(next(iter(law)))}: both given. Give one of them."
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
    motion = {name: getattr(model, name) or None for name in MOTION}
    if model.name:
        return {"model": model.name, "tau1": model.law.tau1} | motion
    return law_options(model.law) | motion


def model_code(**options) -> str:
    """Python text of a model that these options describe."""
    law = {name: value for name, value in options.items() if name not in MOTION}
    if law:
        return law_code(**law)
    return f"jampetsc.models.CDn({', '.join(f'{name}={value!r}' for name, value in options.items())})"


MODEL_IN_PYTHON = "jampetsc.models.CDn(mass=…), a damping law, a Model of it or " + ", ".join(
    f'"{name}"' for name in MODELS
)
MODEL = CompositeParameter(
    (*OWN, *law_parameters(None)),
    build_model,
    model_options,
    Model,
    "model of the flow",
    MODEL_IN_PYTHON,
    model_code,
)
