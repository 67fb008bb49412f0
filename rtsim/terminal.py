"""The terminal as a source of single keys, also for a job that was stopped and goes on.

Legend:
    descriptor: The terminal.
    foreign: Whether one counts as ours that controls nobody here, and so stops nobody.
"""

from __future__ import annotations

import contextlib
import errno
import os
import termios
import tty


def in_foreground(descriptor: int, *, foreign: bool = False) -> bool:
    """Whether the terminal is ours to use; a job in the background that touched it would be stopped by the kernel."""
    try:
        return os.tcgetpgrp(descriptor) == os.getpgrp()
    except OSError as error:
        return foreign and error.errno == errno.ENOTTY and os.isatty(descriptor)


def take_keys(descriptor: int, *, foreign: bool = False) -> None:
    """Have keys arrive without Enter, now or again: after Ctrl-Z and ``fg`` the shell has given it another mode.

    Ctrl-C and Ctrl-Z still work.
    """
    with contextlib.suppress(OSError, termios.error):
        modes = termios.tcgetattr(descriptor)[3]
        if modes & (termios.ICANON | termios.ECHO) and in_foreground(descriptor, foreign=foreign):
            tty.setcbreak(descriptor, termios.TCSADRAIN)
