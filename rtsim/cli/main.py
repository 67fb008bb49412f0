"""The ``rtsim`` command: collects the command modules and turns every ending into a sentence and an exit code."""

from __future__ import annotations

import atexit
import importlib
import importlib.util
import os
import sys
import threading
from collections.abc import Sequence
from contextlib import nullcontext, suppress
from typing import Annotated, NoReturn

import typer

from rtsim import __version__
from rtsim.cli import stopping
from rtsim.cli.build_text import build_notice
from rtsim.cli.compile_text import compile_notice
from rtsim.cli.help_text import App
from rtsim.cli.options import with_values
from rtsim.cli.output import machine_output
from rtsim.cli.surroundings import leave_settings_of_others
from rtsim.errors import EXIT_BAD_INPUT, EXIT_OUTPUT_FAILED, RtsimError

EXIT_INTERNAL_ERROR = 70
EXIT_BROKEN_PIPE = 141
EXIT_INTERRUPTED = 130

COMMAND_MODULES = {
    "Fly": ("fly", "scenarios", "joystick", "flightgear", "timing"),
    "Look at a flight": ("log", "view", "replay"),
    "Look at the aircraft": ("analysis", "rotor", "performance", "corridor", "model", "pilot", "validate"),
    "Test and search": ("check", "test", "campaign", "breaking", "optimize", "reproduce"),
}
"""Modules of ``rtsim.cli`` under the headings of ``rtsim --help``; each has ``register(app)``."""


def database_hash() -> str:
    """Give the SHA-256 of the shipped LPV database, or say why there is none."""
    if importlib.util.find_spec("rtsim.lpv.files.storage") is None:
        return "none"
    try:
        database = importlib.import_module("rtsim.lpv.files.storage").load_database()
    except RtsimError:
        return "none"
    return str(database.content_hash)


def _print_version(wanted: bool) -> None:
    if wanted:
        sys.stdout.write(f"rtsim {__version__} (database {database_hash()})\n")
        raise typer.Exit


def _root(
    version: Annotated[
        bool,
        typer.Option(
            "--version", help="Print the version and the hash of the database.", callback=_print_version, is_eager=True
        ),
    ] = False,
) -> None:
    """Fly the Bell XV-15 tiltrotor in real time: a virtual pilot or you at the controls, its corridor beside it.

    Begin with:
        rtsim fly  # hover to airplane mode in 66 s; the viewer opens where there is a display
        rtsim scenarios  # what else there is to fly
        rtsim fly conversion_turn --log turn.parquet  # the same with a turn, kept in a log
        rtsim plot turn.parquet  # pictures of it
        rtsim fly manual_flight --pilot mavlink  # fly it yourself: in another terminal, rtsim joystick
        rtsim test ep21_steep_turn  # a flight as a test of the protection, with a verdict
        rtsim COMMAND --help  # every option of a command, with examples
    """


def build_app() -> typer.Typer:
    """Build the command with every command module registered."""
    app = App(
        name="rtsim",
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    )
    app.callback()(_root)
    for heading, names in COMMAND_MODULES.items():
        before = len(app.registered_commands), len(app.registered_groups)
        for name in names:
            importlib.import_module(f"rtsim.cli.{name}").register(app)
        for command in app.registered_commands[before[0] :]:
            command.rich_help_panel = heading
        for group in app.registered_groups[before[1] :]:
            group.rich_help_panel = heading
    return app


def _fail(sentence: str) -> None:
    try:
        sys.stderr.write(f"rtsim: error: {' '.join(sentence.split())}\n")
        sys.stderr.flush()
    except OSError:
        pass  # nobody is left to tell; the exit code still says it


def _silence(*, stdout_only: bool = False) -> None:
    """Point the streams at nothing, so that the interpreter's last flush cannot complain."""
    sink = os.open(os.devnull, os.O_WRONLY)
    for stream in (sys.stdout,) if stdout_only else (sys.stdout, sys.stderr):
        try:
            os.dup2(sink, stream.fileno())
        except (OSError, ValueError):
            continue  # a replaced stream without descriptor has nothing to flush to
    os.close(sink)


def _open_closed_streams() -> None:
    """Give a process that was started without a standard stream (``>&-``) an empty one.

    Otherwise the next file opened would get the descriptor, and whatever is printed would end up in it.
    """
    for descriptor, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest free descriptor: this one
        if getattr(sys, name) is None:
            stream = os.fdopen(descriptor, "r" if descriptor == 0 else "w", encoding="utf-8", closefd=False)
            setattr(sys, name, stream)


def _describe(error: OSError) -> str:
    name = error.filename if error.filename is not None else "output"
    if isinstance(name, bytes):
        name = os.fsdecode(name)
    return f"{name}: {error.strerror or error}"


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command and give its exit code.

    Args:
        arguments: The words after ``rtsim``; None takes them from the process.

    Returns:
        0 done and all expectations held; 1 an expectation failed or a replay differs; 2 bad input; 3 stopped by the
        overrun policy; 4 a file or socket failed; 70 a fault of rtsim's own; 130 Ctrl-C; 141 the reader of the output
        went away; 129, 131, 143 SIGHUP, SIGQUIT, SIGTERM.
    """
    try:
        code = _invoke(arguments)
        with suppress(ValueError):  # a user's own code closed it
            sys.stdout.flush()
    except RtsimError as error:
        _fail(str(error))
        return error.exit_code
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        _silence()
        return EXIT_BROKEN_PIPE
    except OSError as error:
        _silence(stdout_only=True)
        _fail(_describe(error))
        return EXIT_OUTPUT_FAILED
    except Exception:  # noqa: BLE001 - the last resort: a fault of ours, told apart from the user's by its exit code
        if (number := stopping.stopped_by()) is not None:  # what was raised for it was lost, and something failed later
            return stopping.exit_code(number)
        import traceback

        traceback.print_exc()
        _fail("this is a fault of rtsim itself, not of your input; please report it with the lines above.")
        return EXIT_INTERNAL_ERROR
    return code


def _invoke(arguments: Sequence[str] | None) -> int:
    command = typer.main.get_command(build_app())
    try:
        words = with_values(sys.argv[1:] if arguments is None else arguments)
        with compile_notice(), build_notice(), machine_output() if "--json" in words else nullcontext():
            result = command.main(args=words, prog_name="rtsim", standalone_mode=False)
    except SystemExit as end:
        # The parser turns a broken pipe into exit 1, which is our code for a failed expectation.
        if isinstance(end.__context__, BrokenPipeError):
            raise end.__context__ from None
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except typer.Abort as abort:
        if isinstance(abort.__cause__ or abort.__context__, EOFError):  # for the parser that is Ctrl-C too
            raise (abort.__cause__ or abort.__context__) from None  # type: ignore[misc]
        return EXIT_INTERRUPTED
    except RuntimeError as end:
        if isinstance(end, typer.Exit):
            return int(end.exit_code)
        raise
    except Exception as error:
        message = getattr(error, "format_message", None)
        if message is None:
            raise
        return _usage_error(error, str(message()))
    return result if isinstance(result, int) else 0


def _usage_error(error: Exception, message: str) -> int:
    """Tell a mistake in the command line, and where its help is."""
    context = getattr(error, "ctx", None)
    path = context.command_path if context is not None else "rtsim"
    if type(error).__name__ == "NoArgsIsHelpError":
        sys.stdout.write(f"{message}\n")
    else:
        ending = "" if message.endswith("?") else "."
        _fail(f"{message.rstrip('.')}{ending}{_perhaps_a_scenario(message)} Try '{path} --help'.")
    return EXIT_BAD_INPUT


def _perhaps_a_scenario(message: str) -> str:
    """What to type where a scenario's name stands in the place of a command."""
    word = message.partition("No such command '")[2].partition("'")[0]
    if not word:
        return ""
    from scenarios.files.loader import library_names

    return f" It is a scenario: rtsim fly {word}." if word in library_names() else ""


def main() -> None:
    """Entry point of the ``rtsim`` command: handles the signals of the process, then ends it with the exit code."""
    _open_closed_streams()
    leave_settings_of_others()
    stopping.catch_signals()
    code = run()
    stopping.leave_at_once(code)
    _leave(code)


def _leave(code: int) -> NoReturn:
    """End the process, whatever threads a user's own code has left running."""
    here = threading.current_thread()
    if not any(thread is not here and not thread.daemon for thread in threading.enumerate()):
        sys.exit(code)
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)


if __name__ == "__main__":
    main()
