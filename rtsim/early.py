"""What the ``rtsim`` command does before anything else is imported: a signal ends it without a word.

``rtsim.cli.stopping`` catches signals later. Only modules that load in no time may be imported here.
"""

import os
import signal
import sys


def end_by_signals() -> None:
    """Let a signal end the command at once while it is imported; in anybody else's process nothing changes."""
    if not _is_command():
        return
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        if number == signal.SIGINT or signal.getsignal(number) != signal.SIG_IGN:  # as ``catch_signals`` has it
            signal.signal(number, lambda number, _frame: os._exit(128 + number))


def _is_command() -> bool:
    """Whether this process is ``rtsim`` or ``python -m rtsim``."""
    program: str = (getattr(sys, "argv", None) or [""])[0]
    if program != "-m":  # stands there until Python has found the module
        return program.rpartition("/")[2] == "rtsim"
    options = zip(sys.orig_argv, sys.orig_argv[1:], strict=False)
    return any(module == "rtsim" and option[:1] == "-" and option[-1:] == "m" for option, module in options)
