"""A state folder that can be made read-only while processes work with it, as a disk with errors is remounted.

A few lines of C stand before the C library's (`LD_PRELOAD`). While a shared file says so, what would change a file in
the folder fails with EROFS: also through files that are open already, which permissions alone do not forbid.
"""

import struct
from pathlib import Path

from tests.support.processes.wall_clock import build

_FLAG, _FOLDER = "ROLLING_PANDA_READ_ONLY", "ROLLING_PANDA_READ_ONLY_FOLDER"
_SOURCE = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

static volatile long long *flag;
static const char *folder;
static size_t length;

__attribute__((constructor)) static void open_flag(void) {
    const char *name = getenv("%s");
    folder = getenv("%s");
    length = folder ? strlen(folder) : 0;
    int (*real)(const char *, int, ...) = dlsym(RTLD_NEXT, "open");
    int file = name && folder ? real(name, O_RDONLY) : -1;
    void *at = file < 0 ? MAP_FAILED : mmap(0, sizeof(long long), PROT_READ, MAP_SHARED, file, 0);
    if (at != MAP_FAILED) flag = at;
}

static int path_is_shut(const char *path) {
    return flag && *flag && path && !strncmp(path, folder, length) && (path[length] == '/' || !path[length]);
}

static int file_is_shut(int file) {
    char link[64], path[4096];
    if (!flag || !*flag) return 0;
    snprintf(link, sizeof link, "/proc/self/fd/%%d", file);
    ssize_t got = readlink(link, path, sizeof path - 1);
    if (got < 0) return 0;
    path[got] = 0;
    return path_is_shut(path);
}

static int shut(void) { errno = EROFS; return -1; }

#define OPEN(name) \\
    int name(const char *path, int how, ...) { \\
        static int (*real)(const char *, int, ...); \\
        if (!real) real = dlsym(RTLD_NEXT, #name); \\
        va_list rest; va_start(rest, how); mode_t mode = va_arg(rest, mode_t); va_end(rest); \\
        if ((how & (O_WRONLY | O_RDWR | O_CREAT | O_TRUNC)) && path_is_shut(path)) return shut(); \\
        return real(path, how, mode); \\
    }
OPEN(open)
OPEN(open64)

#define WRITE(name, kind, arguments, values) \\
    kind name arguments { \\
        static kind (*real) arguments; \\
        if (!real) real = dlsym(RTLD_NEXT, #name); \\
        return file_is_shut(file) ? shut() : real values; \\
    }
WRITE(write, ssize_t, (int file, const void *data, size_t size), (file, data, size))
WRITE(pwrite, ssize_t, (int file, const void *data, size_t size, off_t at), (file, data, size, at))
WRITE(pwrite64, ssize_t, (int file, const void *data, size_t size, off64_t at), (file, data, size, at))
WRITE(ftruncate, int, (int file, off_t size), (file, size))
WRITE(ftruncate64, int, (int file, off64_t size), (file, size))
WRITE(fsync, int, (int file), (file))
WRITE(fdatasync, int, (int file), (file))

#define NAME(name, arguments, values, path) \\
    int name arguments { \\
        static int (*real) arguments; \\
        if (!real) real = dlsym(RTLD_NEXT, #name); \\
        return path_is_shut(path) ? shut() : real values; \\
    }
NAME(rename, (const char *from, const char *to), (from, to), to)
NAME(unlink, (const char *path), (path), path)
NAME(mkdir, (const char *path, mode_t mode), (path, mode), path)
"""


class StateDisk:
    """The state folder of processes that are started with `environment`."""

    def __init__(self, place: Path) -> None:
        """Writable at first; `place` takes the folder `state` and the files.

        Raises:
            InputError: There is no C compiler.
        """
        self.folder = place.resolve() / "state"
        library, self._flag = place / "state_disk.so", place / "state_disk"
        build(_SOURCE % (_FLAG, _FOLDER), library)
        self._flag.write_bytes(struct.pack("q", 0))
        self.environment = {"LD_PRELOAD": str(library), _FLAG: str(self._flag), _FOLDER: str(self.folder)}

    def set_read_only(self, read_only: bool) -> None:
        """From now on nothing in the folder can be changed, or everything again."""
        with self._flag.open("r+b", buffering=0) as file:
            file.write(struct.pack("q", int(read_only)))
