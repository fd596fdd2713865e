"""Children that end when we do, however we end."""

import ctypes
import os
import signal
import sys
from collections.abc import Callable

PR_SET_PDEATHSIG = 1  # of linux/prctl.h


def ends_with_us() -> Callable[[], None] | None:
    """What `subprocess.Popen(preexec_fn=…)` runs in the child, so that the child is told to end with us.

    The kernel watches the thread that starts the child: start it from one that lives as long as the process.
    None where the system cannot do that (it is not Linux).
    """
    if sys.platform != "linux":
        return None
    # Loaded before the fork: the child must not do more than these two calls.
    libc, parent = ctypes.CDLL(None), os.getpid()

    def end_with_parent() -> None:
        libc.prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
        if os.getppid() != parent:  # it ended before we asked
            os._exit(1)

    return end_with_parent
