"""Files without checksums are read by another process first, because libhdf5 may not survive them.

Older files, those of other programs and those that were edited have no hash to look at, and libhdf5 ends by a signal,
or not at all, on some bytes that a disk changed. So a process that has nothing to lose, with limits on time and memory,
reads such a file to its end; only what it gets through is opened here. That takes 0.2 s, once for each file and
process. What the child finds wrong in an orderly way is left to the reader, who says it in his words.
"""

import hashlib
import io
import os
import resource
import signal
import stat
import subprocess
import sys
from contextlib import contextmanager

from jampetsc.launcher import without_launcher

_SECONDS = 10  # of the processor, for a small file
_RATE = 50_000_000  # bytes per second of the processor that reading any file gets through
_MEMORY = 4 << 30  # bytes, beside twice the file
_PIECE = 1 << 24  # bytes of a dataset read at a time
_TOO_MUCH = 42  # exit status of a child that asked for more memory
_passed = set()  # identities of files that a child got through


def failure_of(file) -> str | None:
    """What ends a process that reads the binary `file` as HDF5, None if it gets through.

    A new process is started, not forked, which MPI would forbid. Where none can be started the file passes.
    """
    identity, size, source = _identity(file)
    if identity in _passed:
        return None
    limits = _SECONDS + size // _RATE, _MEMORY + 2 * size
    command = [sys.executable or "python3", "-m", "jampetsc.storage.trial", *map(str, limits)]
    environment = without_launcher(os.environ) | {"OPENBLAS_NUM_THREADS": "1"}
    silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    try:
        status = subprocess.run(command, env=environment, check=False, **source, **silent).returncode
    except OSError:
        return None
    if status == -signal.SIGXCPU:
        return "libhdf5 comes to no end with it"
    if status < 0:
        return f"libhdf5 does not survive it: signal {-status}"
    if status == _TOO_MUCH:
        return "it says that it is larger than any memory"
    _passed.add(identity)
    return None


def _identity(file):
    """(what tells the file from others and from itself before a change, bytes, the child's standard input)."""
    try:
        status = os.fstat(file.fileno())
        identity = status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns
        return identity, status.st_size, {"stdin": file.fileno()}
    except OSError:  # bytes in memory
        file.seek(0)
        content = file.read()
        return hashlib.sha256(content).digest(), len(content), {"input": content}


def _child(seconds, memory) -> int:
    """Read the HDF5 file that is the standard input to its end."""
    import h5py

    if stat.S_ISREG(os.fstat(0).st_mode):  # opened anew: the parent's place in it stays
        file = open("/dev/fd/0", "rb")
    else:
        file = io.BytesIO(sys.stdin.buffer.read())
    resource.setrlimit(
        resource.RLIMIT_CPU, (seconds, seconds + 5)
    )  # the second limit would kill without a reason
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        with _orderly(), h5py.File(file, "r") as h5:
            _read(h5)
            h5.visititems(lambda name, item: _read(item))
    except MemoryError:
        return _TOO_MUCH
    return 0


def _read(item):
    from jampetsc.storage.hdf5 import values

    with _orderly():
        list(item.attrs.items())
    if not hasattr(item, "is_virtual"):  # a group
        return
    with _orderly():
        if item.is_virtual:
            item.virtual_sources()
        elif not item.shape:
            values(item)
        else:
            rows = max(1, _PIECE * item.shape[0] // max(1, item.nbytes))
            for start in range(0, item.shape[0], rows):
                values(item, slice(start, start + rows))


@contextmanager
def _orderly():
    """Goes on after any error but a lack of memory."""
    try:
        yield
    except MemoryError:
        raise
    except Exception:
        pass


if __name__ == "__main__":
    sys.exit(_child(*map(int, sys.argv[1:])))
