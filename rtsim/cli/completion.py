"""What the shell offers for a word that is begun: names of the library besides the files it knows itself."""

from __future__ import annotations

from collections.abc import Callable


def scenario_names(incomplete: str) -> list[str]:
    """Scenarios of the library.

    Args:
        incomplete: The word as far as it is typed.
    """
    from scenarios.files.loader import library_names

    return [name for name in library_names() if name.startswith(incomplete)]


def campaign_names(incomplete: str) -> list[str]:
    """Campaigns of the library.

    Args:
        incomplete: The word as far as it is typed.
    """
    from rtsim.toml_file import shipped_names
    from scenarios.campaign.spec import LIBRARY

    return [name for name in shipped_names(LIBRARY) if name.startswith(incomplete)]


def one_of(*words: str) -> Callable[[str], list[str]]:
    """What offers some words, where others are possible too.

    Args:
        words: To offer.
    """

    def offer(incomplete: str) -> list[str]:
        return [word for word in words if word.startswith(incomplete)]

    return offer
