"""Flow curves of files: mean stresses of groups of flows at their rates, and quasistatic shear of their particles."""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.analysis.correlated_series import facts_of, mean_of_facts, own_error_of_runs
from jampetsc.analysis.flow_laws import FlowCurve
from jampetsc.commands.collapse_points import PHI_DECIMALS
from jampetsc.errors import InputError, named
from jampetsc.io.provenance import LAW_PARAMETERS, recorded_dimension
from jampetsc.options.values import input_name

FLOW, SHEAR = FORMATS = "jampetsc-flow", "jampetsc-shear"
COLUMNS = ("model", "mass", "phi", "n", "sizes", "potential")  # by which flows may be grouped
PARTICLE_SETTINGS = ("phi", "n", "dimension", "sizes", "potential", "exponent", "stiffness", "units", "k")
FLOW_SETTINGS = (
    "model",
    *PARTICLE_SETTINGS,
    "background_drag",
    "walls",
    *LAW_PARAMETERS,
)  # the mass among these


@dataclass(frozen=True, eq=False)
class FlowGroup:
    """Flows of one kind at several rates."""

    label: str  # what tells it apart, in words; empty for a single group
    first: object  # one of its results
    curve: FlowCurve
    pressure: np.ndarray  # (M, 2) means and errors
    runs: np.ndarray  # (M,) number of flows at each rate
    quasistatic: tuple | None = None  # ((σ, error), (p, error)) of quasistatic shear

    @property
    def seed_count(self) -> int:
        """Number of seeds that have all rates; 1 where seeds differ between rates."""
        return 1 if self.curve.seeds is None else len(self.curve.seeds)

    def below(self, cut: float) -> "FlowGroup":
        """The flows at rates up to `cut`."""
        kept = self.curve.rate <= cut
        return replace(self, curve=self.curve.below(cut), pressure=self.pressure[kept], runs=self.runs[kept])


def setting(result, name):
    """A setting of a flow or a shear, as files of one group have in common."""
    attributes = result.attributes
    if name == "dimension":
        return recorded_dimension(attributes)
    if name == "phi":
        return round(float(attributes["phi"]), PHI_DECIMALS)
    return attributes["particle_count"] if name == "n" else attributes.get(name)


def read_groups(results, by=()) -> list[FlowGroup]:
    """The groups of flows that differ in the settings `by`, each with the quasistatic shear of its particles.

    Raises InputError for files of other formats, that differ in more, or that are there twice; for flows without an
    error of their mean; and for quasistatic shear of other particles.
    """
    for result in results:
        if getattr(result, "format", "") not in FORMATS:
            raise InputError(
                f"{input_name(result)}: not supported. Give flow files, and shear files to compare with."
            )
    flows, sheared = ([result for result in results if result.format == name] for name in FORMATS)
    if not flows:
        raise InputError(
            f"{results[0].path}: quasistatic shear alone. Give flow files at several rates as well."
        )
    groups = {}
    for result in flows:
        _refuse_other_settings(result, flows[0], [name for name in FLOW_SETTINGS if name not in by])
        groups.setdefault(tuple(setting(result, name) for name in by), []).append(result)
    ordered = sorted(groups.items(), key=lambda item: tuple(map(_order, item[0])))
    quasistatic = _quasistatic_groups(sheared, {key: own[0] for key, own in ordered})
    return [_flow_group(own, ", ".join(map(_words, by, key)), quasistatic.get(key)) for key, own in ordered]


def _order(value):
    """A key by which settings of any kind are sorted."""
    return (0, value, "") if isinstance(value, int | float) else (1, 0, str(value))


def _words(name, value):
    """A setting in words: phi = 0.86, N = 64, RD0, no sizes."""
    if isinstance(value, int | float):
        return f"{'N' if name == 'n' else name} = {value:.6g}"
    return value or f"no {name}"


def _refuse_other_settings(result, first, names):
    """Raise InputError for a flow with other settings than the first one."""
    for name in names:
        value, expected = (setting(item, name) for item in (result, first))
        if value != expected:
            groups = f", or group them: {named('by')} {name}" if name in COLUMNS else ""
            raise InputError(
                f"{result.path}: {name} {value}, but {first.path.name} has {expected}. Give files of one kind{groups}."
            )


def _origin(result) -> str:
    """The start of a run: its seed, or its packing."""
    attributes = result.attributes
    return (
        f"seed {attributes['seed']}"
        if "seed" in attributes
        else str(attributes.get("packing_sha256", "one start"))
    )


def _runs_by_origin(results, key) -> dict:
    """{key(result): {origin: result}}. Raises InputError where a run is there twice."""
    runs = {}
    for result in results:
        own, origin = runs.setdefault(key(result), {}), _origin(result)
        if origin in own:
            raise InputError(
                f"{result.path}: start and rate as in {own[origin].path.name}. Give each run once."
            )
        own[origin] = result
    return runs


def _facts(runs) -> list:
    """The attributes of runs by origin."""
    return [result.attributes for result in runs.values()]


def _flow_group(results, label, quasistatic) -> FlowGroup:
    """The group of flows of one kind."""
    runs = dict(sorted(_runs_by_origin(results, lambda result: float(result.attributes["rate"])).items()))
    rates, rows = np.array(list(runs)), [_facts(own) for own in runs.values()]
    stress, error = np.array([mean_of_facts(row, "shear_stress") for row in rows]).T
    own = np.array([own_error_of_runs(*facts_of(row, "shear_stress")[1:]) for row in rows])
    if not np.isfinite([rates, stress]).all():
        raise InputError(f"{results[0].path}: a rate or mean stress that is not finite. Make the file again.")
    for rate, value in zip(rates, own, strict=True):
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(
                f"{results[0].path}: no error of the mean stress at rate {rate:g}, which a fit needs. Shear longer."
            )
    origins = sorted(next(iter(runs.values())))
    seeds = None
    if len(origins) > 1 and all(sorted(own) == origins for own in runs.values()):
        seeds = np.array(
            [
                [float(own[origin].attributes["shear_stress_mean"]) for own in runs.values()]
                for origin in origins
            ]
        )
    pressure = np.array([mean_of_facts(row, "pressure") for row in rows])
    curve = FlowCurve(rates, stress, error, own, seeds)
    return FlowGroup(label, results[0], curve, pressure, np.array([len(row) for row in rows]), quasistatic)


def _quasistatic_groups(sheared, firsts) -> dict:
    """{key of a group: ((σ, error), (p, error)) of the quasistatic shear of its particles}; firsts: {key: a flow}."""

    def key_of(result):
        for key, flow in firsts.items():
            if all(setting(result, name) == setting(flow, name) for name in PARTICLE_SETTINGS):
                return key
        first = next(iter(firsts.values()))
        name = next(name for name in PARTICLE_SETTINGS if setting(result, name) != setting(first, name))
        raise InputError(
            f"{result.path}: {name} {setting(result, name)}, but {first.path.name} has {setting(first, name)}. Give "
            "quasistatic shear of the particles of a flow."
        )

    return {
        key: tuple(mean_of_facts(_facts(own), name) for name in ("shear_stress", "pressure"))
        for key, own in _runs_by_origin(sheared, key_of).items()
    }
