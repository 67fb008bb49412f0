"""The paper's claims, each with what was measured and whether it holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rtsim.jsonable import to_jsonable
from rtsim.toml_file import shipped_toml
from scenarios.reproduction.evidence import Evidence, Number
from scenarios.reproduction.flights import Variant
from scenarios.reproduction.judges import JUDGES


@dataclass(frozen=True, slots=True)
class ClaimText:
    """A claim as the paper makes it, from ``data/claims.toml``."""

    id: str
    """Short name, as in the list of claims."""
    where: str
    """Figure, table or section of the paper."""
    claim: str
    """The claim in one sentence."""
    paper: str
    """What the paper says, in its words or numbers."""
    measured: str
    """Template of the sentence with our numbers."""
    holds: str
    """Template: why, if it holds."""
    fails: str
    """Template: why, if it does not."""
    expected: Mapping[str, Any]
    """What is required for it to hold."""
    flights: bool = False
    """Whether it rests on flights, and is judged for every variant."""


@dataclass(frozen=True, slots=True)
class Claim:
    """A claim, judged."""

    text: ClaimText
    """What the paper says."""
    holds: bool
    """Whether it holds for the baseline."""
    measured: Mapping[str, Number]
    """Our numbers, units in their names."""
    variants: Mapping[str, bool]
    """Whether it holds for each of the other variants, by title; empty where no flight is involved."""

    @property
    def measured_text(self) -> str:
        """Our numbers as a sentence."""
        return self.text.measured.format(**self.measured)

    @property
    def why(self) -> str:
        """Why it holds or not."""
        return (self.text.holds if self.holds else self.text.fails).format(**self.measured)

    @property
    def carried(self) -> str:
        """With which other aircraft models and pilots the verdict is the same; empty where no flight is involved."""
        same = [title for title, holds in self.variants.items() if holds is self.holds]
        other = [title for title, holds in self.variants.items() if holds is not self.holds]
        verdict = "holds" if self.holds else "fails"
        sentences = []
        if same and not other:
            sentences.append(f"{verdict.capitalize()} with every other aircraft model and pilot too.")
        elif same:
            sentences.append(f"{verdict.capitalize()} with {_listed(same)} too.")
        if other:
            sentences.append(f"{'Fails' if self.holds else 'Holds'} with {_listed(other)}.")
        return " ".join(sentences)

    def to_json(self) -> dict[str, Any]:
        """The claim as JSON values: ``id``, ``holds``, ``measured``, ``expected`` and the texts."""
        return {
            "id": self.text.id,
            "holds": self.holds,
            "measured": to_jsonable(self.measured),
            "expected": dict(self.text.expected),
            "where": self.text.where,
            "claim": self.text.claim,
            "paper": self.text.paper,
            "found": self.measured_text,
            "why": self.why,
            "carried": self.carried,
            "variants": dict(self.variants),
        }


def _listed(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def claim_texts() -> tuple[ClaimText, ...]:
    """All claims, in the order of the paper."""
    return tuple(ClaimText(**entry) for entry in shipped_toml("scenarios/reproduction/data", "claims.toml")["claim"])


def judge_claims(baseline: Evidence, others: Mapping[Variant, Evidence]) -> tuple[Claim, ...]:
    """Judge every claim.

    Args:
        baseline: What counts.
        others: What the other variants show, for the claims that rest on flights.
    """
    claims = []
    for text in claim_texts():
        judge = JUDGES[text.id]
        holds, measured = judge(baseline, text.expected)
        variants = {}
        if text.flights:
            variants = {variant.title: judge(evidence, text.expected)[0] for variant, evidence in others.items()}
        claims.append(Claim(text, bool(holds), measured, variants))
    return tuple(claims)
