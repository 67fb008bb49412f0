"""What would keep a campaign that reads well from being flown: laws, scenarios and an aircraft that are not there."""

from __future__ import annotations

from collections.abc import Callable

from rtsim.errors import InputError
from rtsim.loop.option_tables import given
from rtsim.lpv.files.storage import load_database
from scenarios.campaign.chunks import law_chain, present_folder
from scenarios.campaign.spec import CampaignFile, examine_campaign
from scenarios.files.loader import load_scenario


def every_problem(text: str, *, file: str) -> list[InputError]:
    """All that would keep the text of a campaign from being flown, in one round.

    Args:
        text: The TOML text. Modules of laws in Python are imported.
    """
    try:
        examined = examine_campaign(text, file=file)
    except InputError as error:
        return [error]
    examined.ask(
        lambda spec: law_problems(spec, file),
        lambda spec: scenario_problems(spec, file),
        lambda spec: database_problems(spec, file),
    )
    return examined.problems


def law_problems(spec: CampaignFile, file: str) -> list[InputError]:
    """Laws that do not exist.

    Args:
        spec: The campaign.
    """
    names = {"law": spec.law} | {f"against[{number}]": name for number, name in enumerate(spec.against)}
    return [
        problem
        for key, name in names.items()
        for problem in _refusal(lambda name=name: law_chain(name, present_folder()), file, key)  # type: ignore[misc]
    ]


def scenario_problems(spec: CampaignFile, file: str) -> list[InputError]:
    """Scenarios of classes that do not exist or cannot be read.

    Args:
        spec: The campaign.
    """
    return [
        problem
        for place, item in enumerate(spec.classes)
        for number, name in enumerate(item.scenarios)
        for problem in _refusal(lambda name=name: load_scenario(name), file, f"classes[{place}].scenarios[{number}]")  # type: ignore[misc]
    ]


def database_problems(spec: CampaignFile, file: str) -> list[InputError]:
    """A database that is not there or cannot be read.

    Args:
        spec: The campaign.
    """
    own = given(spec, file).get("database")
    return _refusal(lambda: load_database(own), file, "database") if own else []


def _refusal(look_up: Callable[[], object], file: str, key: str) -> list[InputError]:
    """Why something cannot be found, told where it is named."""
    try:
        look_up()
    except InputError as error:
        return [InputError(str(error).rstrip("."), file=file, key=key)]
    return []
