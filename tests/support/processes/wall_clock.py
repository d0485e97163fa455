"""A wall clock for child processes that can be set while they run; their monotonic clocks stay as they are.

A few lines of C stand before the C library's (`LD_PRELOAD`) and add what a shared file holds.
"""

import shutil
import struct
import subprocess
from collections.abc import Mapping
from pathlib import Path

from rolling_panda.errors import InputError

_FILE = "ROLLING_PANDA_WALL_CLOCK"
_SOURCE = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <time.h>

static volatile long long *ahead;

__attribute__((constructor)) static void open_file(void) {
    const char *name = getenv("%s");
    int file = name ? open(name, O_RDONLY) : -1;
    void *at = file < 0 ? MAP_FAILED : mmap(0, sizeof(long long), PROT_READ, MAP_SHARED, file, 0);
    if (at != MAP_FAILED) ahead = at;
}

int clock_gettime(clockid_t which, struct timespec *out) {
    static int (*real)(clockid_t, struct timespec *);
    if (!real) real = dlsym(RTLD_NEXT, "clock_gettime");
    int code = real(which, out);
    if (code == 0 && ahead && (which == CLOCK_REALTIME || which == CLOCK_REALTIME_COARSE)) out->tv_sec += *ahead;
    return code;
}

int gettimeofday(struct timeval *restrict out, void *restrict zone) {
    struct timespec now;
    int code = clock_gettime(CLOCK_REALTIME, &now);
    out->tv_sec = now.tv_sec;
    out->tv_usec = now.tv_nsec / 1000;
    return code;
}

time_t time(time_t *out) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (out) *out = now.tv_sec;
    return now.tv_sec;
}
"""


def together(*environments: Mapping[str, str]) -> dict[str, str]:
    """Environments that each stand before the C library, as one."""
    libraries = [each["LD_PRELOAD"] for each in environments]
    return {name: value for each in environments for name, value in each.items()} | {"LD_PRELOAD": ":".join(libraries)}


def build(source: str, library: Path) -> None:
    """A library of C that is loaded before all others.

    Raises:
        InputError: There is no C compiler.
    """
    compiler = shutil.which("cc")
    if compiler is None:
        raise InputError("setting clock or disk of other processes needs a C compiler: install cc, or leave that out")
    file = library.with_suffix(".c")
    file.write_text(source, encoding="ascii")
    subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", library, file, "-ldl"], check=True)


class WallClock:
    """The clock that children started with `environment` see."""

    def __init__(self, folder: Path) -> None:
        """Right at first; `folder` takes the files.

        Raises:
            InputError: There is no C compiler.
        """
        library = folder / "wall_clock.so"
        build(_SOURCE % _FILE, library)
        self._file = folder / "wall_clock"
        self._file.write_bytes(struct.pack("q", 0))
        self.environment = {"LD_PRELOAD": str(library), _FILE: str(self._file)}

    def set(self, ahead_s: int) -> None:
        """From now on the children's wall clock is so many seconds ahead; negative is behind."""
        with self._file.open("r+b", buffering=0) as file:
            file.write(struct.pack("q", ahead_s))
