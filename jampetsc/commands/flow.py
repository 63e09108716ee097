"""Steady shear at a rate."""

from dataclasses import dataclass
from typing import ClassVar

from jampetsc.errors import InputError, named
from jampetsc.io.outputs import check_place, is_same
from jampetsc.laws.damping import Law
from jampetsc.laws.flow_models import MODELS, Model
from jampetsc.options.model_options import MODEL
from jampetsc.options.parameters import FILE, composite_parameter, optional_parameter, parameter
from jampetsc.options.starts import GROUP, ShearJob, run_parameter
from jampetsc.options.task_inputs import PACKING_OR_N, TaskInputs
from jampetsc.options.values import PACKING_OR_RESULT, input_name, load_source
from jampetsc.packing.packing import Packing
from jampetsc.petsc import launcher
from jampetsc.progress import note

TOLERANCE = 1e-4


@dataclass(frozen=True, eq=False)
class Flow(ShearJob):
    """Steady shear at a rate: stress, pressure, energy balance.

    Shears soft disks steadily under Lees–Edwards conditions, by one of Vågberg's six models (thesis sec. 4.3) or a
    damping law, overdamped or with a mass. Starts from a packing, or from random disks of a given number and packing
    fraction; or continues an earlier flow with its settings.
    """

    STUDY_INPUTS: ClassVar = TaskInputs(PACKING_OR_N)
    scalar: ClassVar = None
    OUT: ClassVar = "optional"
    OUT_HELP: ClassVar = "result file (default when a flow is continued: its own file)"
    EPILOG: ClassVar = """examples:
  jampetsc flow --n 1024 --phi 0.8433 --model RD0 --rate 1e-3 --strain 20 --snapshots 40 --out rd0.h5
  jampetsc flow p.h5 --model CD0 --rate 1e-4 --strain 5 --out cd0.h5
  jampetsc flow --n 256 --phi 0.78 --model CDn --mass 1 --rate 1e-3 --strain 40 --out cdn.h5
  jampetsc flow rd0.h5 --strain 20                      # twenty more

A killed run continues when the same command is given again. Many disks use several cores, with the same result
to the last bit; independent runs are faster side by side. The same seed gives the same trajectory where it gives the
same packing (`jampetsc pack --help`); elsewhere trajectories part, and only averages agree."""

    start: Packing | None = optional_parameter(
        "packing to start from, or flow to continue",
        value_type=PACKING_OR_RESULT,
        place=FILE,
        metavar="START",
    )
    model: Model | Law | str | None = composite_parameter(MODEL, None)
    rate: float | None = optional_parameter("shear rate γ̇", above=0.0, high=1.0, metavar="R")
    strain: float = parameter(help="how far to shear", above=0.0, metavar="S")
    walls: bool = parameter(False, "between sliding rough walls, rows of disks", group=GROUP)
    snapshots: int | None = run_parameter(
        "number of states to keep, at equal strains after what is discarded", low=0, metavar="K"
    )
    snapshot_every: float | None = run_parameter(
        "strain between snapshots, instead of their number", above=0.0, metavar="S"
    )
    snapshot_spacing: str | None = run_parameter(
        "log: states at strains that grow by a factor, for mean square displacements (default even)",
        choices=("even", "log"),
    )
    step: float | None = run_parameter("time step (default: by the model)", above=0.0, metavar="DT")
    tolerance: float | None = run_parameter(
        f"of the velocities of contact damping (default {TOLERANCE:g})", low=1e-14, high=0.1, metavar="T"
    )

    def __post_init__(self):
        if isinstance(self.model, Law):  # overdamped
            object.__setattr__(self, "model", Model(self.model))
        super().__post_init__()

    def check(self):
        self.check_discard()
        every, spacing = named("snapshot_every"), named("snapshot_spacing")
        if self.snapshot_every is not None and (self.snapshots is not None or self.snapshot_spacing == "log"):
            raise InputError(f"{every}: leave out {named('snapshots')} and {spacing} log")
        if self.snapshot_spacing is not None and not self.snapshots:
            raise InputError(f"{spacing}: how many? give {named('snapshots')}")
        earlier = self._in_memory
        if earlier is not None:
            if earlier.format != self.FORMAT:
                raise InputError(f"{earlier.path}: is no flow: give a packing, or a flow to go on from")
            self._refuse_settings(earlier.path)
        elif self.start is None or self._own_settings:
            super().check()
            if self.rate is None:
                raise InputError(f"{named('rate')}: must be given: how fast to shear?{self._hint}")
            if self.model is None:
                known = f"{', '.join(MODELS)}, or {named('law')} with its options"
                raise InputError(f"{named('model')}: must be given: {known}{self._hint}")
            if self.step is not None and not self.rate * self.step <= self.strain * (1.0 + 1e-9):
                raise InputError(
                    f"{named('step')} {self.step:g}: is longer than the whole run, {self.strain / self.rate:g} for "
                    f"{named('strain')} {self.strain:g}: give a shorter one"
                )

    @property
    def _in_memory(self):
        """The result in memory that is given as START, or None."""
        return None if self.start is None or isinstance(self.start, str | Packing) else self.start

    @property
    def _hint(self):
        """End of a message where a START is given, in case it was meant to be continued."""
        return (
            "" if self.start is None else f"; a flow goes on as it was begun, given {named('strain')} alone"
        )

    @property
    def _own_settings(self):
        """Parameters that only a new flow may be given: a continued one keeps its own."""
        return [name for name in self.settings() if name not in ("strain", "last", "threads")]

    def _refuse_settings(self, path):
        """Raise InputError for settings that belong to the flow at `path`, which is continued."""
        for name in self._own_settings:
            raise InputError(f"{named(name)}: {path} goes on as it was begun; leave it out (or start anew)")

    @property
    def place(self):
        """The flow file that is continued, which the result replaces."""
        if not self._continues:
            raise InputError(f"{named('out')}: must be given: where to write the result?")
        return self.start

    @property
    def _continues(self):
        """Whether START is a flow to continue."""
        from jampetsc.flows.steady import is_flow

        return self._in_memory is not None or (isinstance(self.start, str) and is_flow(self.start))

    def check_outputs(self, to):
        """See `Job`; but a continued flow may replace its own file."""
        if (
            to.path is not None
            and isinstance(self.start, str)
            and is_same(to.path, self.start)
            and self._continues
        ):
            check_place(to.path, self.FORMAT)
            self.check_last(to)
        else:
            super().check_outputs(to)

    def work(self, to):
        from jampetsc.flows import steady as flows

        run = self._continued_run() if self._continues else self._new_run()
        if launcher.several():
            note("one rank does one flow, on threads; independent runs use more ranks")
        return flows.summary(run, to, flows.execute(run, to, self.write_last, self.team))

    def _continued_run(self):
        """The run that continues an earlier flow."""
        from jampetsc.flows.steady import continued

        earlier = load_source(self.start)
        self._refuse_settings(earlier.path)
        return continued(earlier, self.strain)

    def _new_run(self):
        """The run of a new flow."""
        from jampetsc.flows.steady import begun

        if not self._own_settings:
            raise InputError(
                f"{input_name(self.start)}: is no flow to go on from: give {named('model')} and {named('rate')}"
            )
        disks, origin = self.disks()
        return begun(
            disks,
            origin,
            self.model.of_stiffness(disks.potential.k),
            self.rate,
            self.strain,
            discard=self.discard,
            snapshots=self.snapshots or 0,
            every=self.snapshot_every,
            spacing=self.snapshot_spacing or "even",
            step=self.step,
            tolerance=self.tolerance or TOLERANCE,
        )

    def protocol(self, attributes):
        return f"steady shear, {attributes['model']}, rate {attributes['rate']:g}"

    def random(self, radii, seed):
        """See `ShearJob`; `walls` in the attributes is the number of disks, the first ones, that make up the walls."""
        if not self.walls:
            return super().random(radii, seed)
        from jampetsc.flows.walls import between_walls

        disks, held = between_walls(radii, self.phi, seed, self.made_potential)
        return disks, {"walls": held}
