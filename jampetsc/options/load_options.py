"""The load of a job: a displacement gradient, by name or by its numbers."""

from jampetsc.laws.loads import DEFAULT, TENSOR, load_text, loads_of
from jampetsc.options.parameters import ValueType, parameter

LOAD = ValueType(load_text, metavar="LOAD")  # text of a load, see `laws.loads.load_text`
LOAD_HELP = (
    "load, a displacement gradient E: xy or yx (simple shear), pure-xy, compression, xx, yy, or D² numbers row by row "
    f"(4 with commas; on a command line with = where the first is negative); {TENSOR}: {{}}. Moduli are those of the "
    "energy along F = 1 + εE"
)


def load_parameter(of_tensor: str):
    """The parameter `load` of a job; of_tensor: what it finds for all symmetric loads."""
    return parameter(DEFAULT, LOAD_HELP.format(of_tensor), value_type=LOAD)


def is_shear(load: str) -> bool:
    """Whether the modulus G of a load, its text, is a shear modulus; that of the tensor is."""
    return load == TENSOR or all(one.is_shear for one in loads_of(load, 2))
