"""`jampetsc merge FILE`: one plain file out of a joint file and its parts."""

import os


def add_parser(subparsers) -> None:
    """Add the command to the command line."""
    parser = subparsers.add_parser(
        "merge",
        help="make one plain file of a result written by many ranks",
        description="Make one plain file of a result that many ranks wrote, in place unless --out is given.",
    )
    parser.add_argument("file", metavar="FILE", help="result of sweep, quasistatic, modes, …")
    parser.add_argument("--out", metavar="FILE", help="write there and leave FILE and its parts as they are")
    parser.set_defaults(run=run)


def run(args, petsc_argv) -> int:
    """Merge and say what was done."""
    from jampetsc.storage.merge import merge

    joined = merge(args.file, args.out)
    if joined:
        print(f"{args.out or args.file}: {joined} parts in one file")
    elif args.out and not os.path.samefile(args.out, args.file):
        print(f"{args.out}: copy of {args.file}, which was one file already")
    else:
        print(f"{args.file}: one file already, nothing to do")
    return 0
