"""The command line: its parser, messages and exit status. Modules of commands are imported only when needed."""
