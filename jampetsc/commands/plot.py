"""Pictures of the content of files."""

import functools
from dataclasses import dataclass
from typing import ClassVar

from jampetsc.commands.sources import WHERE, rows_named
from jampetsc.errors import as_float
from jampetsc.options.job import Job
from jampetsc.options.parameters import (
    FILES,
    WORD,
    CompositeParameter,
    Parameter,
    ValueType,
    composite_parameter,
    optional_parameter,
    parameter,
)
from jampetsc.options.values import PACKING_NETWORK_OR_RESULT, split_list


def _given(**options) -> dict:
    """The options without switches that are off."""
    return {name: value for name, value in options.items() if value is not False}


@functools.cache
def _options() -> tuple[Parameter, ...]:
    """The kind of picture, and the options of all kinds."""
    from jampetsc.plots.draw import pictures

    kinds = pictures()
    kind = Parameter(
        "kind",
        "kind of picture (default: by files and options)",
        WORD,
        None,
        choices=tuple(kinds),
        metavar="KIND",
    )
    return kind, *dict.fromkeys(option for picture in kinds.values() for option in picture.options)


def _size(text):
    try:
        width, height = map(as_float, split_list(text))
    except (TypeError, ValueError):
        raise ValueError("must be the width and height in inches, e.g. 3.4,2.9") from None
    if not (0.5 <= width <= 100 and 0.5 <= height <= 100):
        raise ValueError("must be from 0.5 to 100 inches")
    return width, height


def _limits(text):
    try:
        pairs = [
            tuple(float(limit) for limit in pair.split(":")) if pair else None for pair in text.split(",")
        ]
    except (AttributeError, ValueError):
        pairs = [()]
    if not all(pair is None or (len(pair) == 2 and pair[0] < pair[1]) for pair in pairs):
        raise ValueError("must be LOW:HIGH, e.g. 1e-6:1, or one for each panel with commas")
    return pairs[0] if len(pairs) == 1 else pairs


LIMITS = ValueType(_limits, str, metavar="LOW:HIGH")
LIMITS_HELP = (
    "limits of {} in all panels, or in each panel with commas (default, and where empty: by the data)"
)


@dataclass(frozen=True, eq=False)
class Plot(Job):
    """Draw sweeps, packings, flows and all other results.

    G' and G'' of sweeps and oscillations, K*, Poisson's ratio and elastic constants of sweeps of the tensor, the
    scaling collapse of sweeps, relaxation spectra with stress relaxation and creep, correlations of displacements
    and their length, a packing with its contacts and forces, a network, displacement fields of a sweep,
    quasistatic responses, modes, or steady shear: series of one rate, flow curves of several, snapshots, velocities
    and their correlation; quasistatic shear along the strain; the share of samples that jam, f(phi), and their
    pressures, P(p).
    In three dimensions packings, networks and snapshots are a slice z = const beside a view of the cell; fields,
    responses, modes and velocities are slices, with arrows of their x and y components and colours of z.
    Frequencies are shown in 1/τ₁, moduli and pressures in k, in three dimensions over the unit of length.
    """

    FORMAT: ClassVar = "picture"
    scalar: ClassVar = None
    OUT_HELP: ClassVar = "picture to write: .png, .pdf or .svg"
    AGAIN: ClassVar = True
    EPILOG: ClassVar = """examples:
  jampetsc plot s1e-2.h5 s1e-3.h5 s1e-4.h5 --out moduli.png           # G' and G'' of three sweeps
  jampetsc plot s1e-2.h5 s1e-3.h5 s1e-4.h5 --kind collapse --out collapse.pdf
  jampetsc plot C-sweep.h5 --kind bulk --out bulk.png                 # K* and G* of a sweep of the tensor
  jampetsc plot p.h5 --out packing.svg
  jampetsc plot spheres.h5 --height 0.25 --out slice.png              # three dimensions: z = L_z/4, and a view
  jampetsc plot net.h5 --out network.pdf                              # bonds of a network
  jampetsc plot sweep.h5 --kind fields --omega 1e-3 --total --out fields.png
  jampetsc plot modes.h5 --mode 1,2,5 --out modes.png                 # on the packing
  jampetsc plot q-p*.h5 --kind medians --out medians.png              # of quasistatic files
  jampetsc plot ensemble --kind exponents --out exponents.png         # means over the packings of a study
  jampetsc plot ensemble --where beta=1e-3 --out beta.png           # results with this beta
  jampetsc plot rd0-*.h5 --size 7,4 --csv flow.csv --out flow.pdf     # flow curves of several rates
  jampetsc plot rd0-*.h5 --kind stress --out stress.pdf               # sigma alone against the rate
  jampetsc plot hb.h5 --out hb.png                                    # sigma and p of a fit of `scaling`
  jampetsc plot rows.h5 --kind start-up --out start.png               # sigma against strain before it is steady
  jampetsc plot rd0-*.h5 --panels a,f --out two.pdf                   # two panels of six
  jampetsc plot s1e-2.h5 s1e-3.h5 --label first,second --color tab:red,black --out two.png
  jampetsc plot ensemble --kind loss --where beta=1e-3 --by pressure --out by.png   # means over all else
  jampetsc plot rd0.h5 --kind snapshot --out snapshot.png
  jampetsc plot f64.h5 f256.h5 --out f.png                            # of jam files: f(phi) with errors
  jampetsc plot f64.h5 qs.h5 --kind pressures --out pressures.png     # P(p), with quasistatic shear

Without --kind each result is drawn in the way that suits it."""

    files: tuple = parameter(
        help="files of results or packings, or the folder of a study",
        value_type=PACKING_NETWORK_OR_RESULT,
        place=FILES,
    )
    where: str | None = WHERE
    csv: str | None = optional_parameter("table of the drawn numbers to write, .csv", metavar="FILE")
    size: tuple | None = optional_parameter(
        "width and height of the figure in inches (default: by kind)",
        value_type=ValueType(_size, metavar="W,H"),
    )
    xlim: tuple | None = optional_parameter(LIMITS_HELP.format("x"), value_type=LIMITS)
    ylim: tuple | None = optional_parameter(LIMITS_HELP.format("y"), value_type=LIMITS)
    label: tuple | None = optional_parameter(
        "texts for each file, in their order, or for the groups of the legend, in its order",
        value_type=ValueType(split_list, ",".join, metavar="TEXT,…"),
    )
    color: tuple | None = optional_parameter(
        "colours of files or groups, as label: names of matplotlib, or #rrggbb",
        value_type=ValueType(split_list, ",".join, metavar="COLOR,…"),
    )
    panels: str | None = optional_parameter(
        "letters of the panels to show, in rows divided by / (default: all)", metavar="a,b[/c,d]"
    )
    style: str | None = optional_parameter(
        "style file of matplotlib (.mplstyle), applied after the style of jampetsc; its axes.prop_cycle colours the "
        "groups",
        metavar="FILE",
    )
    options: dict = composite_parameter(CompositeParameter(_options, _given, dict, dict))

    def check_outputs(self, to):
        """Left to `draw`, which checks them once the kind of picture is known."""

    def work(self, to):
        from jampetsc.plots.draw import draw
        from jampetsc.plots.page import panel_rows

        items = rows_named(self.files, self.where)
        chosen = {name: getattr(self, name) for name in ("size", "xlim", "ylim", "style")}
        chosen |= {"label": self.label or (), "color": self.color or ()}
        chosen["panels"] = panel_rows(self.panels) if self.panels else None
        out = None if to.path is None else str(to.path)
        return f"{out}: {draw(items, out=out, csv=self.csv, chosen=chosen, **self.options).text}"
