"""One study at a time in a folder, on one machine or many that share a disk.

`FOLDER/lock` is locked by the system. On some network file systems such locks hold within one machine only; therefore
the file is also touched every TOUCH_INTERVAL, and a lock that another machine has touched within MAX_TOUCH_AGE
counts as held: after the loss of a node the folder becomes free when they have passed.
"""

import contextlib
import os
import socket
import tempfile
import threading
import time
from pathlib import Path

from jampetsc.errors import InputError
from jampetsc.io.atomic import locked, write_error

NAME = "lock"
TOUCH_INTERVAL = 20.0  # seconds between touches of the file
MAX_SHOWN_CHARACTERS = 200  # characters of its content in a message
MAX_TOUCH_AGE = 120.0  # seconds without a touch after which a study on another machine counts as dead


class Lock:
    """The lock of a folder, held from `take` to `release` by one rank of a study."""

    def __init__(self, folder):
        self.path = Path(folder) / NAME
        self._file = None
        self._over = threading.Event()

    def take(self) -> None:
        """Lock the folder. Raises InputError where another study has it."""
        try:
            self._file = locked(self.path)
            host, _, process = (
                self.path.read_text(errors="replace").strip()[:MAX_SHOWN_CHARACTERS].partition(" ")
            )
            age = self._age()
        except OSError as error:
            raise write_error(self.path, error) from None
        here, is_locked = socket.gethostname(), self._file is None
        if is_locked or (host not in ("", here) and age < MAX_TOUCH_AGE):
            if not is_locked:
                self._file.close()
            raise InputError(
                f"{self.path.parent}: a study runs there (process {process or '?'} on "
                f"{host or 'another machine'}). Wait for it, or choose another folder."
                + ("" if is_locked else f" {self._end(age)}")
            )
        self._file.truncate(0)
        self._file.write(f"{here} {os.getpid()}\n")
        self._file.flush()
        threading.Thread(target=self._beat, daemon=True).start()

    def _age(self):
        """Seconds since the file was touched, by the clock of its file system."""
        with tempfile.NamedTemporaryFile(dir=self.path.parent, prefix=f".{NAME}.") as probe:
            return os.fstat(probe.fileno()).st_mtime - os.lstat(self.path).st_mtime

    def _end(self, age):
        """When a lock of another machine expires, in words; age: seconds since it was touched."""
        if age < -MAX_TOUCH_AGE:
            dated = time.strftime("%Y-%m-%d", time.localtime(os.lstat(self.path).st_mtime))
            return f"Its lock has a time in the future ({dated}); if no study runs there, remove {self.path}."
        return f"If it is dead, its lock expires in {MAX_TOUCH_AGE - age:.0f} s."

    def _beat(self):
        while not self._over.wait(TOUCH_INTERVAL):
            with contextlib.suppress(OSError):
                os.utime(self.path, follow_symlinks=False)

    def release(self) -> None:
        """Unlock the folder."""
        self._over.set()
        if self._file is not None and not self._file.closed:
            with contextlib.suppress(OSError):
                self._file.truncate(0)
            self._file.close()
