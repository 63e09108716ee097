"""The keys of a table of STUDY.toml: a command's own long options, as its argparse parser has them."""

import argparse
import difflib
import itertools
from dataclasses import dataclass

from jampetsc.errors import InputError
from jampetsc.words.packtasks import seeds_of

OWN = ("help", "out", "packing", "last", "overwrite", "quiet")  # options that the study gives itself
LABEL = {"n": "n", "pressure": "p", "phi": "phi", "seed": "s"}  # what a file's name tells -> how
STAND_IN = "x.h5"  # for files while values are checked


@dataclass(frozen=True, eq=False)
class Choice:
    """One value for every key of a table."""

    words: tuple  # the options on a command line
    given: dict  # dest of the option -> value, those that the table gives
    changed: dict  # dest -> value, those that differ from the default
    args: argparse.Namespace  # parsed, with STAND_IN for the files

    def arguments(self, positional, inputs, out):
        """The arguments for real files."""
        files = {}
        if positional is not None and inputs:
            files = {positional.dest: inputs if positional.nargs == "+" else inputs[0]}
        return argparse.Namespace(**vars(self.args) | files | {"out": out})


def positional_of(parser):
    """The argument of a command that is no option, or None."""
    return next((action for action in parser._actions if not action.option_strings), None)


def values_of(parser, table: dict, where: str) -> list:
    """[(option of the command, its values)] of a table; `where` names file and table in messages.

    Raises InputError for a key that the command does not have, or a value of the wrong type.
    """
    options = {option[2:]: action for action in parser._actions for option in action.option_strings}
    lists = []
    for key, value in table.items():
        if key in OWN or (key not in options and not (key == "seeds" and "seed" in options)):
            raise InputError(f"{where}: {_unknown(key, options)}")
        lists.append(_values(options, key, value, where))
    return lists


def choices_of(parser, lists: list, where: str, begins: bool) -> list[Choice]:
    """Every combination of what `values_of` has found, in order, the last key running fastest.

    parser   of the command; begins: whether a file is given to its positional argument

    Raises InputError for a value that the command refuses.
    """
    positional = positional_of(parser)
    stand_in = [STAND_IN] if positional is not None and begins else []
    found = []
    actions = [action for action, _ in lists]
    for values in itertools.product(*(values for _, values in lists)):
        chosen = list(zip(actions, values, strict=True))
        words = [word for action, value in chosen for word in words_of(action, value)]
        try:
            args = parser.parse_args([*stand_in, "--out", STAND_IN, *words])
            args.check(args)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
        dests = [action.dest for action in actions]
        parsed = {dest: value for dest, value in vars(args).items() if dest in dests}
        changed = {dest: value for dest, value in parsed.items() if value != parser.get_default(dest)}
        found.append(Choice(tuple(words), {d: number_of(v) for d, v in parsed.items()}, changed, args))
    return found


def _unknown(key, options):
    if key in OWN:
        return f"{key}: the study itself gives --{key}: leave it out"
    near = difflib.get_close_matches(key, set(options) - set(OWN), n=1)
    return f"{key}: no such option{f'; did you mean {near[0]}?' if near else ''}"


def _values(options, key, value, where):
    """(action, its values) for one key. Raises InputError."""
    if key == "seeds" and "seed" in options:  # one task per seed, not one run of the command for all
        key, value = "seed", _seeds(value, where)
    action, values = options[key], value if isinstance(value, list | range) else [value]
    if not values:
        raise InputError(f"{where}: {key} = []: give at least one value")
    for one in () if isinstance(values, range) else values:
        if action.nargs == 0 and not isinstance(one, bool):
            raise InputError(f"{where}: {key} = {one!r}: is a switch: write true or false")
        if action.nargs != 0 and (isinstance(one, bool) or not isinstance(one, int | float | str)):
            raise InputError(
                f"{where}: {key} = {_toml(one)}: must be a number or a string, or a list of such"
            )
    return action, values


def _seeds(value, where):
    """The seeds of "first:last", a range; a list or one number as it is."""
    if not isinstance(value, str):
        return value
    try:
        return seeds_of(value)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _toml(value):
    return str(value).lower() if isinstance(value, bool) else str(value)


def words_of(action, value):
    """The words of a command line for one value of an option, the same for 1e-3 and "0.001"."""
    option = action.option_strings[0]
    if action.nargs == 0:
        return [option] if value else []
    value = number_of(value)
    text = repr(value) if isinstance(value, float) else str(value)
    return [f"{option}={text}"] if text.startswith("-") else [option, text]


def number_of(value):
    """A number where a string is one, anything else as it is."""
    if isinstance(value, str):
        for kind in (int, float):
            try:
                return kind(value)
            except ValueError:
                continue
    return value


def label_of(columns: dict) -> str:
    """What the name of a file tells of its task: n1024-p0.001-s1."""
    told = [
        f"{short}{columns[name]:g}"
        for name, short in LABEL.items()
        if isinstance(columns.get(name), int | float)
    ]
    return "-".join(told)
