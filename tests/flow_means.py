"""Flows and quasistatic shear of which only the means are there, of a planted law in units of k and τ₁ other than 1."""

import numpy as np
from samples import stored

from jampetsc.analysis.flow_laws import FlowLaw

RATES = np.geomspace(1e-4, 1e-1, 6)
K, TAU1 = 2.5, 0.4
PARTICLES = {"potential": "harmonic", "stiffness": "constant", "units": "those of the packing", "k": K}
LAWS = {0.86: FlowLaw(1e-3, 0.2, 0.5), 0.9: FlowLaw(5e-3, 0.3, 0.6)}


def flow(path, rate, seed=1, phi=0.86, noise=0.02, samples=400.0, **more):
    """A flow of which the means are there, with the stress of the law at its φ."""
    number = [seed, round(1e8 * rate), round(1e3 * phi)]
    exact = float(LAWS[round(phi, 6)].stress(rate))
    facts = {
        "model": "RD0",
        "mass": 0.0,
        "tau1": TAU1,
        "rate": rate,
        "phi": phi,
        "particle_count": 64,
        "seed": seed,
    }
    for name, value in (("shear_stress", exact), ("pressure", 8.0 * exact), ("contact_number", 4.0)):
        mean = value * (1.0 + noise * np.random.default_rng(number).standard_normal())
        facts |= {f"{name}_mean": mean, f"{name}_error": noise * value, f"{name}_samples": samples}
    return stored(path, "flow", {}, **PARTICLES | facts | more)


def sheared(path, phi=0.86, seed=1, stress=1.1e-3, **more):
    """Quasistatic shear of which the means are there."""
    facts = {"phi": phi, "particle_count": 64, "seed": seed}
    for name, value in (("shear_stress", stress), ("pressure", 8 * stress)):
        facts |= {f"{name}_mean": value, f"{name}_error": 0.05 * value, f"{name}_samples": 400.0}
    return stored(path, "shear", {}, **PARTICLES | facts | more)
