"""The version of the program, which the package has as `jampetsc.__version__`, and that of the layout of its files."""

VERSION = "0.1.0"
FORMAT_VERSION = "1.1"  # 1.0: `contacts/pairs` are rows of `particles`
