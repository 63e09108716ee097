"""Kinds of steady shear that a picture tells apart: what their runs have in common, and words for legends."""

from jampetsc.plots.picture import join_varied, other_settings, potential_text
from jampetsc.plots.style import number

# settings of runs of one kind: what they record beside them, and how long they take
_KNOWN = ("model", "mass", "quality", "rate", "walls", "strain")


def kind_of(result) -> tuple:
    """What flow curves have in common: model, φ, N, (Q or m, its value), sizes and potential, what a study has set."""
    attributes = result.attributes
    walls = " between walls" if "walls" in attributes else ""
    inertia = "Q" if "quality" in attributes else "m"
    state = (
        f"{attributes['model']}{walls}",
        round(float(attributes["phi"]), 6),
        int(attributes["particle_count"]),
        (inertia, float(attributes["quality" if inertia == "Q" else "mass"])),
    )
    words = str(attributes.get("sizes", "")), potential_text(attributes), other_settings(result, _KNOWN)
    return *state, *words


def labels_of(kinds) -> list[str]:
    """A legend's words for each of `kinds`: the parts that differ between them, the model where none does."""
    parts, varied = _parts_of(kinds)
    return [words or row[0] for words, row in zip(join_varied(parts, varied), parts, strict=True)]


def shared_words(kinds) -> str:
    """Model, φ and N that all of `kinds` have, for the title of a legend; the model alone is its only entry."""
    parts, varied = _parts_of(kinds)
    shared = [not differs for differs in varied[:3]]
    shared[0] = shared[0] and any(varied)
    return join_varied([parts[0][:3]], shared)[0]


def _parts_of(kinds):
    """(rows of words of each kind, which of their columns tell kinds apart)."""
    parts = [
        (model, rf"$\phi={phi:.6g}$", f"$N={n}$", f"${name}={number(value)}$" if value else "no mass", *words)
        for model, phi, n, (name, value), *words in kinds
    ]
    varied = [len(set(column)) > 1 for column in zip(*kinds, strict=True)]
    varied[3] = varied[3] and len({(kind[0], kind[3]) for kind in kinds}) > len({kind[0] for kind in kinds})
    return parts, varied
