"""What `jampetsc plot --kind` can draw: which pictures there are, and which of them suits the files that are given."""

from jampetsc.errors import InputError
from jampetsc.words import response_pictures, shear_pictures
from jampetsc.words.files import files_named

COMMANDS = {  # format -> the command, where they have two names
    "correlation": "correlate",
    "velocity-correlation": "correlate",
    "packing": "pack",
}
# A file shows by itself the first that suits it and the options given.
PICTURES = response_pictures.PICTURES | shear_pictures.PICTURES


def open_files(paths, kinds):
    """What the files hold, and the kinds that show all of it: ("packing", [Disks], […]), ….

    Raises InputError for a mixture that none of the kinds shows, and for several packings.
    """
    from jampetsc.contacts.disks import Disks
    from jampetsc.storage.reader import load

    found = [load(path) for path in paths]
    held = ["packing" if isinstance(item, Disks) else item.format.removeprefix("jampetsc-") for item in found]
    other = next((n for n, kind in enumerate(held) if kind != held[0]), None)
    together = [k for k in kinds if PICTURES[k].mixed and set(held) <= set(PICTURES[k].of)]
    if other is not None and not together:
        hint = "; the packing of a sweep goes with --packing" if "packing" in held else ""
        raise InputError(
            f"{paths[0]} is a {_noun(held[0])}, {paths[other]} a {_noun(held[other])}: "
            f"one picture shows one or the other{hint}"
        )
    if held[0] == "packing" and len(paths) > 1:
        raise InputError(f"{len(paths)} packings: one picture shows one packing; plot them one by one")
    return held[0], found, kinds if other is None else together


def of_studies(paths, kinds, where=None) -> tuple[list[str], bool]:
    """`files_named`: of the folder of a study those that one of the kinds can show. Raises InputError if none can."""

    def chosen(path, done, here):
        suited = [_shown(done, PICTURES[kind]) for kind in kinds]
        found = next((rows for rows, kind in zip(suited, kinds, strict=True) if fits(rows, kind)), None)
        if found is None:
            held = ", ".join(sorted(set(done["command"].tolist()))) or "nothing"
            what = " or ".join(kinds) if len(kinds) < len(PICTURES) else "a"
            hint = "; of those that show a single file, name the file" if any(r.rows for r in suited) else ""
            raise InputError(f"{path}: a study with {held}{here}: nothing for {what} picture{hint}")
        return found

    return files_named(paths, where, chosen)


def _shown(done, picture):
    """The rows of a study whose files a kind of picture shows: of those not `mixed` the first format that is there."""
    made = [COMMANDS.get(name, name) for name in picture.of]
    if not picture.mixed:
        made = [next((command for command in made if command in done["command"].tolist()), made[0])]
    return done.where(command=made)


def fits(rows, kind) -> bool:
    """Whether a kind of picture shows so many files."""
    return rows.rows == 1 or (rows.rows > 1 and not PICTURES[kind].single)


def choose(kinds, held: str, paths) -> str:
    """The picture to draw of files that hold this, out of those that the options leave.

    Raises InputError where none of them shows such files, or not so many.
    """
    kind = next((name for name in kinds if held in PICTURES[name].of), kinds[0])
    if held not in PICTURES[kind].of:
        needed = " or ".join(_plural(what) for what in PICTURES[kind].of)
        raise InputError(f"{paths[0]}: is a {held} file: {kind} pictures need {needed}")
    if PICTURES[kind].single and len(paths) > 1:
        raise InputError(f"{len(paths)} {held} files: {kind} pictures show one; plot them one by one")
    return kind


def _plural(word):
    return {"packing": "a packing", "spectrum": "spectra"}.get(word, f"{_noun(word)}s")


def _noun(word):
    return (
        f"{word} file"
        if word in ("modes", "quasistatic", "flow", "shear", "jam", "velocity-correlation", "collapse")
        else word
    )
