"""A campaign from Python: draws flights, flies each with a law and without, and counts.

python examples/campaign_from_python.py                      # from anywhere
rtsim campaign misuse --runs 2                               # what it does is what this command does
"""

from __future__ import annotations

from scenarios.campaign.run import CampaignOptions, run_campaign
from scenarios.campaign.spec import parse_campaign

CAMPAIGN = """
format = 1
name = "early_switch"
title = "The nacelle switch is held forward too early"
law = "full"
against = ["governor"]
duration_s = 25
runs = 10

[[classes]]
name = "early"
start = { airspeed_kt = { uniform = [30, 80] }, nacelle_deg = { uniform = [75, 85] } }
pulses = [{ channel = "switch", time_s = { uniform = [1, 3] }, duration_s = 15, amount = { uniform = [-7.5, -3] } }]

[[expect]]
name = "none deeper than 5 kn"
event = "deep"
rate_max = 0.0
"""


def main() -> None:
    """Fly the campaign in this process and show what every law left."""
    campaign, problems = parse_campaign(CAMPAIGN, file="campaign_from_python.py")
    if campaign is None:
        raise problems[0]
    result = run_campaign(campaign, CAMPAIGN, options=CampaignOptions(seed=1, early_stop=False))
    for law in result.report()["laws"]:
        outside = law["events"]["exceeded"]
        print(f"{law['law']:<9} {outside['count']:2} of {outside['total']} flights leave the corridor")
    for expectation in result.judged:
        print(f"{expectation.name}: {'held' if expectation.held else 'not held'}")


if __name__ == "__main__":
    main()
