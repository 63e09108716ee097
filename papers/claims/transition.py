"""V 6.4: some transitions between Newtonian and Bagnoldian flow are sharp.

Primary estimator. The largest ratio of σ at Q two apart, of CD at φ = .74, γ̇ = 1e-5, in scans up and down, where a
power of Q as in either state changes σ by less than SMOOTH: at Q between them the flow goes from one state to the other
and back. Whether the scans differ bears on hysteresis.
"""

import numpy as np

from papers.claims.shared import Row, check, claim
from papers.claims.verdicts import Estimate, between
from papers.tables.transition import falls, scans

SMOOTH = 2.0  # σ ~ m^½ to m of free flight would give 1.25 between Q two apart
APART = 2.0  # in Q


@claim("sharp-transition", on="sharp")
def sharp_transition(table):
    size, places = f"N = {table['n'].max():.0f}, γ̇ = {table['rate'].min():g}", {}
    for direction, (quality, stress, error, cluster) in scans(table).items():
        steps = round(APART / np.diff(quality).min())
        place, change, own = falls(quality, stress, error, max(steps, 1))
        places[direction] = place
        ratio = float(np.exp(change))
        note = (
            f"at Q = {place:.1f}; σ = {stress[0]:.2e} and {stress[-1]:.2e}, largest cluster {cluster[0]:.2f} and "
            f"{cluster[-1]:.2f} N at the ends"
        )
        what = f"CD, φ = 0.74, Q {direction}: largest ratio of σ at Q two apart"
        words, part = f"sharp: > {SMOOTH:g}", f"Q {direction}"
        yield Row(what, words, Estimate(ratio, ratio * own), between(low=SMOOTH), note, size, part=part)
    shift, step = places["up"] - places["down"], float(np.diff(np.unique(table["quality"])).min())
    yield check("CD, φ = 0.74: Q of the transition, up less down", shift, step / 12**0.5, "", size)
