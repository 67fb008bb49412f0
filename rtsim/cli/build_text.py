"""Says what database is built and how far that is; silent while none is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

from rtsim.cli.output import console, progress
from rtsim.cli.stopping import raise_if_lost


@contextmanager
def build_notice() -> Iterator[None]:
    """Tell about databases that are built while a command runs."""
    from rtsim.loop.aircraft import told

    bar: list[Callable[[float], None]] = []
    done = 0.0
    with ExitStack() as stack:

        def note(words: str, share: float | None) -> None:
            nonlocal done
            raise_if_lost()
            if share is None:
                console.print(f"{words}.", soft_wrap=True)
                return
            if not bar:
                bar.append(stack.enter_context(progress("Trims, linear models and pilots", total=1.0)))
            bar[0](share)
            done += share
            if done > 1.0 - 1e-6:  # what comes next has the terminal for itself
                stack.close()
                bar.clear()
                done = 0.0

        with told(note):
            yield
