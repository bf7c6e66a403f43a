"""Commands run on a disk that fails, or ended, at the n-th call that changes what is on it.

A library that is loaded before the C library counts those calls of a process that concern files below a
folder, and at one of them reports an error, or raises a signal.
"""

from __future__ import annotations

import errno
import os
import signal
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from samples.command_line import COMMAND
from vsacli.base.interrupts import ENDING_SIGNALS

PATIENCE = 60
"""Seconds until a run that should have ended counts as broken."""

SOURCE = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

#define GENUINE(type, name, ...) \
    static type (*genuine)(__VA_ARGS__); \
    if (!genuine) \
        genuine = (type (*)(__VA_ARGS__))dlsym(RTLD_NEXT, #name)

static int setting(const char *name)
{
    const char *text = getenv(name);
    return text ? atoi(text) : 0;
}

static void tell(int file, int number, const char *call, const char *path)
{
    GENUINE(ssize_t, write, int, const void *, size_t);
    char line[2 * PATH_MAX];
    const int size = snprintf(line, sizeof line, "%d %s %s\n", number, call, path);
    genuine(file, line, (size_t)size);
}

/* Whether a call shall fail. */
static int disturbed(const char *call, const char *path)
{
    static int calls;
    const char *folder = getenv("DISTURBED_FOLDER");
    char whole[2 * PATH_MAX], here[PATH_MAX];
    if (!folder || !path)
        return 0;
    snprintf(whole, sizeof whole, "%s/%s", path[0] == '/' || !getcwd(here, sizeof here) ? "" : here, path);
    if (!strstr(whole, folder))
        return 0;
    calls++;
    const int at = setting("DISTURBED_AT"), lasting = setting("DISTURBED_LASTING");
    if (setting("DISTURBED_TOLD"))
        tell(setting("DISTURBED_TOLD"), calls, call, path);
    if (!at || calls < at || (calls > at && (!lasting || !strcmp(call, "rename") || !strcmp(call, "link"))))
        return 0;
    if (setting("DISTURBED_SIGNAL"))
        raise(setting("DISTURBED_SIGNAL"));
    errno = setting("DISTURBED_ERROR");
    return errno != 0;
}

/* The same of a file that is open for writing. */
static int disturbed_file(const char *call, int file)
{
    char link[64], path[PATH_MAX];
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    const ssize_t size = readlink(link, path, sizeof path - 1);
    if (size <= 0 || path[0] != '/' || (fcntl(file, F_GETFL) & O_ACCMODE) == O_RDONLY)
        return 0;
    path[size] = 0;
    return disturbed(call, path);
}

ssize_t write(int file, const void *data, size_t size)
{
    GENUINE(ssize_t, write, int, const void *, size_t);
    return disturbed_file("write", file) ? -1 : genuine(file, data, size);
}

int fsync(int file)
{
    GENUINE(int, fsync, int);
    return disturbed_file("fsync", file) ? -1 : genuine(file);
}

int ftruncate64(int file, off64_t size)
{
    GENUINE(int, ftruncate64, int, off64_t);
    return disturbed_file("truncate", file) ? -1 : genuine(file, size);
}

int close(int file)
{
    GENUINE(int, close, int);
    const int fails = disturbed_file("close", file), error = errno;
    const int result = genuine(file);
    errno = fails ? error : errno;
    return fails ? -1 : result;
}

int rename(const char *from, const char *to)
{
    GENUINE(int, rename, const char *, const char *);
    return disturbed("rename", to) ? -1 : genuine(from, to);
}

int link(const char *from, const char *to)
{
    GENUINE(int, link, const char *, const char *);
    return disturbed("link", to) ? -1 : genuine(from, to);
}

int linkat(int a, const char *from, int b, const char *to, int flags)
{
    GENUINE(int, linkat, int, const char *, int, const char *, int);
    return disturbed("link", to) ? -1 : genuine(a, from, b, to, flags);
}

int mkdir(const char *path, mode_t mode)
{
    GENUINE(int, mkdir, const char *, mode_t);
    return disturbed("mkdir", path) ? -1 : genuine(path, mode);
}

#define OPENING(name) \
    int name(const char *path, int flags, ...) \
    { \
        GENUINE(int, name, const char *, int, ...); \
        va_list rest; \
        va_start(rest, flags); \
        const mode_t mode = flags & O_CREAT ? (mode_t)va_arg(rest, int) : 0; \
        va_end(rest); \
        return flags & O_CREAT && disturbed("open", path) ? -1 : genuine(path, flags, mode); \
    }

OPENING(open)
OPENING(open64)
"""


@dataclass(frozen=True)
class Disturbance:
    """What happens at a call.

    Attributes:
        at: number of the call, from 1; 0 for none.
        error: that it reports.
        number: signal that is raised before it instead; 0 for none.
        lasting: whether later calls fail, too, but for those that give files names.
    """

    at: int = 0
    error: int = errno.ENOSPC
    number: int = 0
    lasting: bool = False

    @property
    def environment(self) -> dict[str, str]:
        """Variables that tell the library."""
        values = {"AT": self.at, "ERROR": 0 if self.number else self.error, "SIGNAL": self.number}
        values["LASTING"] = self.lasting
        return {f"DISTURBED_{name}": str(int(value)) for name, value in values.items()}


@dataclass(frozen=True)
class Disturber:
    """Runs commands in `here` of a folder below which calls are counted.

    Attributes:
        library: that is loaded before the C library.
        folder: the folder.
        environment: variables of the commands.
    """

    library: Path
    folder: Path
    environment: Mapping[str, str]

    @classmethod
    def build(cls, place: Path, folder: Path, environment: Mapping[str, str]) -> Disturber:
        """Compile the library."""
        source, library = place / "disturbed.c", place / "disturbed.so"
        if not library.exists():
            source.write_text(SOURCE)
            flags = ["-shared", "-fPIC", "-O1"]
            subprocess.run(["cc", *flags, str(source), "-o", str(library), "-ldl"], check=True)
        return cls(library, folder, environment)

    def calls(self, *arguments: object) -> list[str]:
        """Each call of an undisturbed run that changes something below the folder, as in "write FILE"."""
        read, write = os.pipe()
        with os.fdopen(read) as stream:
            process = self._start(Disturbance(), *arguments, told=write)
            os.close(write)
            lines = stream.read().splitlines()
        _, err = process.communicate(timeout=PATIENCE)
        assert process.returncode in (0, 3), err
        return [line.partition(" ")[2] for line in lines]

    def run(self, disturbance: Disturbance, *arguments: object) -> tuple[int, str, str]:
        """Exit code, standard output and standard error of a command."""
        process = self._start(disturbance, *arguments)
        out, err = process.communicate(timeout=PATIENCE)
        return process.returncode, out, err

    def start(self, *arguments: object) -> subprocess.Popen[str]:
        """A command that is running, undisturbed."""
        return self._start(Disturbance(), *arguments)

    def _start(self, disturbance: Disturbance, *arguments: object, told: int = 0) -> subprocess.Popen[str]:
        environment = {
            **os.environ,
            **self.environment,
            "LD_PRELOAD": str(self.library),
            "DISTURBED_FOLDER": str(self.folder),
            "DISTURBED_TOLD": str(told),
            **disturbance.environment,
        }
        return subprocess.Popen(
            [str(COMMAND), *map(str, arguments)],
            cwd=self.folder / "here",
            env=environment,
            pass_fds=[told] if told else [],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=allow_interrupts,
        )


def allow_interrupts() -> None:
    """In a child process: undo that a parent may ignore signals, as shells do for background jobs."""
    for number in ENDING_SIGNALS:
        signal.signal(number, signal.SIG_DFL)
