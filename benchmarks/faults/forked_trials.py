"""Work in a child process that begins as a copy of this one: many trials from one start that is costly to reach."""

import os
import pickle
import sys
import traceback
from collections.abc import Callable
from typing import TypeVar

from rolling_panda.errors import RollingPandaError

Result = TypeVar("Result")


def apart(work: Callable[[], Result]) -> Result:
    """What `work()` returns, which must be small; whatever it changes is lost.

    Call it from a process with one thread.

    Raises:
        RollingPandaError: The work failed; how is on standard error.
    """
    readable, writable = os.pipe()
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        code = 1
        try:
            os.close(readable)
            with os.fdopen(writable, "wb") as pipe:
                pickle.dump(work(), pipe)
            code = 0
        except Exception:
            traceback.print_exc()
        finally:
            # Nothing of the parent's is to be closed or written a second time.
            os._exit(code)
    os.close(writable)
    with os.fdopen(readable, "rb") as pipe:
        told = pipe.read()
    _, status = os.waitpid(child, 0)
    if status != 0:
        raise RollingPandaError("work in a child process failed; what it said is above")
    result: Result = pickle.loads(told)
    return result
