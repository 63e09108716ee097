"""Recommends settings from the measured rows, by rules that are printed with them.

For a first look errors may be 5 %, less than a line width on log axes over ten decades; for a figure 0.5 %, a line
width on linear axes; an exponent is given with two digits after the point, so it may change by 0.005.
"""

import math

LOOK, FIGURE = 0.05, 0.005  # largest error of G' and of G''
EXPONENT = 0.005  # largest change of either slope of the critical branch
STAND_IN = 0.05  # simpler physics that changes neither slope by more has the same exponent
SIGNIFICANT = 2.8  # standard errors: 2√2, because the big packing of the same size scatters as much
AS_CHEAP = 1.1  # runs within this ratio of the shortest time are equally fast; the most exact one is taken


def advise(rows) -> list[str]:
    """Lines of recommendation for a table's rows."""
    good = [row for row in rows if not row.failed]
    runs = [row for row in good if row.group in ("accuracy", "method")]
    reference = next(row for row in good if row.group == "reference")
    lines = []
    for use, limit in (("first look", LOOK), ("figure", FIGURE)):
        rule = f"largest error of G' and G'' at most {limit:g}"
        lines.append(f"for a {use} ({rule}): {_cheapest(runs, lambda r, x=limit: r.error <= x, reference)}")
        lines += _frequencies(good, limit)
    if not math.isnan(reference.exponent_storage):
        rule = f"both slopes within {EXPONENT:g} of the reference"
        best = _cheapest(runs, lambda r: _slope_change(r, reference) <= EXPONENT, reference)
        lines.append(f"for an exponent ({rule}): {best}")
        lines += _stand_ins(good, reference)
    rule = f"the fastest run that meets a rule; the most exact of those within {AS_CHEAP - 1:.0%} of its time"
    return [f"recommended is {rule}", *lines, *_packings(good)]


def _cheapest(runs, fits, reference) -> str:
    """The fastest run that fits, as text; among equally fast ones the most exact."""
    fitting = [row for row in runs if fits(row)]
    if not runs:
        return f"the reference, {reference.choice}, {reference.seconds:.2f} s (no other setting was run)"
    if not fitting:
        return f"only the reference, {reference.choice}, {reference.seconds:.2f} s"
    fastest = min(row.seconds for row in fitting)
    best = min((row for row in fitting if row.seconds <= AS_CHEAP * fastest), key=lambda row: row.error)
    error = max(best.error, reference.certified)
    return f"{best.choice}, {best.seconds:.2f} s, error at most {error:.0e}"


def _frequencies(rows, limit):
    """How many frequencies suffice where each one has to be solved."""
    grids = [row for row in rows if row.group == "frequencies"]
    if not grids:
        return []
    enough = min((row for row in grids if row.error <= limit), key=lambda row: row.seconds, default=None)
    if enough is None:
        return [
            f"  solved one by one: more than {grids[-1].choice}; a rational sweep gives G* at any frequency"
        ]
    return [f"  solved one by one: {enough.choice} and interpolation do, {enough.seconds:.2f} s"]


def _slope_change(row, reference):
    """The larger change of a slope; inf where a row has none."""
    changes = [
        abs(getattr(row, f"exponent_{n}") - getattr(reference, f"exponent_{n}")) for n in ("storage", "loss")
    ]
    return math.inf if any(math.isnan(change) for change in changes) else max(changes)


def _stand_ins(rows, reference):
    """Which simpler physics has the same exponents."""
    physics = [row for row in rows if row.group == "physics"]
    if not physics:
        return []
    same = [
        f"{row.choice} ({row.seconds:.2f} s)" for row in physics if _slope_change(row, reference) <= STAND_IN
    ]
    which = ", ".join(same) or "none of those tried"
    return [f"  other physics with both slopes within {STAND_IN:g}: {which}"]


def _packings(rows):
    """Whether many small packings have the mean of a big one, and which accuracy is below their scatter."""
    ensembles = [row for row in rows if row.group == "ensemble"]
    many = [row for row in ensembles if not math.isnan(row.stderr_storage)]
    single = max((_off(row) for row in ensembles if row not in many), default=0.0)
    lines = []
    if single:
        lines.append(
            f"another packing of the same size is off by {single:.1e}: that is the scatter of single ones"
        )
    for row in many:
        off, scatter = _off(row), max(row.stderr_storage, row.stderr_loss)
        same = off <= max(SIGNIFICANT * scatter, single)
        verdict = "no more than scatter" if same else "more than scatter, too few disks each"
        lines.append(
            f"{row.choice}: {row.seconds:.1f} s, mean off by {off:.1e} with standard error {scatter:.1e}, "
            f"{verdict}; an accuracy below {scatter / 10:.0e} is lost in it"
        )
    return lines


def _off(row):
    """The larger deviation of G' and G'': in the critical window if there is one, else anywhere."""
    inside = max(row.window_storage, row.window_loss)
    return row.error if math.isnan(row.window_storage) else inside
