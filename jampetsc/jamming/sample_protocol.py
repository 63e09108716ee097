"""How samples at a packing fraction are made: three protocols, each of which ends at a minimum of the energy.

random    uniformly random disks: Vågberg's RAND ensemble (thesis sec. 4.7, after O'Hern et al., PRE 68, 011306
          (2003))
shear     the minima along quasistatic shear of such a start (thesis sec. 4.7)
compress  a thermal liquid, cooled slowly, quenched, and brought to the φ_J of that sample by changes of its cell
          (Vågberg et al., PRE 83, 031307 (2011), who find that φ_J depends on how it was cooled; their rates and
          schedule are not published); a shear between quench and search shows how much of that dependence survives it
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.errors import InputError, named

PROTOCOLS = {  # options of each, and their defaults
    "random": {},
    "shear": {"step": 1e-3, "strain": 2.0, "discard": 1.0, "every": 0.02},
    "compress": {"temperature": 1e-3, "cooling_rate": 1e-2, "sweeps": 200, "step": None, "strain": None},
}


@dataclass(frozen=True)
class SampleProtocol:
    """How samples are made; options of other protocols are None."""

    name: str = "random"
    step: float | None = None  # shear, compress: Δγ
    strain: float | None = None  # in all; compress: between quench and search
    discard: float | None = None  # shear: strain before the first sample
    every: float | None = None  # strain from one sample to the next
    temperature: float | None = None  # compress: T of the liquid in k_e
    cooling_rate: float | None = None  # decrease of ln T per sweep
    sweeps: int | None = None  # sweeps at T before it cools
    separated: bool = False  # whether large disks start on one side of the cell, see `random_start`

    @classmethod
    def of(cls, name: str, *, separated=False, **options) -> "SampleProtocol":
        """The protocol of PROTOCOLS with these options; defaults stand for None.

        Raises InputError for options of another protocol and for those that do not go together.
        """
        options = {option: value for option, value in options.items() if value is not None}
        for option, value in options.items():
            if option not in PROTOCOLS[name]:
                owners = " or ".join(owner for owner, defaults in PROTOCOLS.items() if option in defaults)
                raise InputError(
                    f"{named(option)} {value:g}: an option of {named('protocol')} {owners}, not {name}. Leave it out."
                )
        values = PROTOCOLS[name] | options
        if name == "compress" and options.keys() & {"step", "strain"}:
            values["step"] = values["step"] or PROTOCOLS["shear"]["step"]
            if not values["strain"] or values["strain"] < values["step"]:
                raise InputError(
                    f"{named('step')} {values['step']:g}: requires a strain of at least that. Give {named('strain')}."
                )
        protocol = cls(name, **values, separated=separated)
        if name == "shear" and not protocol.step <= protocol.every * (1 + 1e-9):
            raise InputError(
                f"{named('every')} {protocol.every:g}: less than a {named('step')} ({protocol.step:g}). Give more."
            )
        if protocol.rows < 1:
            raise InputError(
                f"{named('strain')} {protocol.strain:g}: ends before the first sample ({named('discard')} "
                f"{protocol.discard:g} and {named('every')} {protocol.every:g}). Give a longer one."
            )
        return protocol

    @property
    def rows(self) -> int:
        """Samples of one seed."""
        if self.name != "shear":
            return 1
        return int(np.floor((self.strain - self.discard) / self.every + 1e-9))

    @property
    def facts(self) -> dict:
        """Its options that are set, by name."""
        options = {option: value for option, value in vars(self).items() if option != "name"}
        return {
            option: value for option, value in options.items() if value is not None and value is not False
        }

    @property
    def columns(self) -> tuple:
        """Names of the columns of its samples."""
        more = {"shear": ("strain",), "compress": ("phi_J", "segregation")}
        return "phi", "seed", "energy", "pressure", "jammed", "contact_number", *more.get(self.name, ())
