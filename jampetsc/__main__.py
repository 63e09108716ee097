"""The command jampetsc, and python -m jampetsc."""

import gc
import signal
import sys


def main():
    """Run the command of sys.argv, and end."""
    gc.set_threshold(10_000)  # objects until garbage is looked for: to compile loops takes a tenth less
    # python's own handler would end the imports with a traceback; while a job runs see `interrupts`
    if signal.getsignal(signal.SIGINT) == signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from jampetsc.main import main

    sys.exit(main())


if __name__ == "__main__":
    main()
