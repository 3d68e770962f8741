"""How `hprs explain` prints."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hprs.cli.console import plural, print_json, print_table

if TYPE_CHECKING:
    from hprs.explanation.explanation import Explanation, Part
    from hprs.explanation.film import Film


def print_explanation(found: Explanation, film: Film, written: Sequence[Path]) -> None:
    """Print a table of the requirements, the most important first, and what was written."""
    from hprs.explanation.wording import bound, change, number, percent, summary

    def row(part: Part) -> tuple[str, ...]:
        return (
            part.name,
            *(number(part.contributions[state]) for state in (0, -1)),
            change(part.earned),
            change(part.cost),
            percent(part.fraction),
            _when(found, part),
            number(part.worst),
            f"[{bound(part.low)}, {bound(part.high)}]",
        )

    shaping = found.shaping
    total = (
        "potential",
        *(number(found.potential[state]) for state in (0, -1)),
        change(float(shaping[shaping > 0.0].sum())),
        change(float(shaping[shaping < 0.0].sum())),
    )
    header = (
        "contribution of", "start", "end", "earned", "cost", "held", "first violation",
        "worst margin", "within",
    )  # fmt: skip
    rows = [*map(row, found.parts), total + ("",) * (len(header) - len(total))]
    title = f"{found.title}\n{summary(found)}"
    print_table(header, rows, title=title, breaks=(len(rows) - 2,))
    print()
    for name, count in found.assessment.outside.items():
        print(f"Signal '{name}' left its range in {count:,} of {plural(found.steps + 1, 'state')}.")
    if found.assessment.decided_at_start:
        print("The first state decided this episode already.")
    for note in found.notes:
        print(note)
    if film.trouble:
        print(f"{'No more' if film.frames else 'No'} pictures: {film.trouble}")
    print(f"Wrote {' and '.join(map(str, written))}")


def _when(found: Explanation, part: Part) -> str:
    if part.is_target:
        met = part.met_from
        return "not met" if met is None else f"met from {met:,}{found.after(met)}"
    violated = part.first_violation
    return "none" if violated is None else f"{violated:,}{found.after(violated)}"


def print_explanation_json(found: Explanation, film: Film, written: Sequence[Path]) -> None:
    """Print the same as JSON."""
    assessed = found.assessment
    content: dict[str, Any] = {
        "subject": found.title,
        "steps": found.steps,
        "rate": found.rate,
        "pam": assessed.pam,
        "safe": assessed.safe,
        "target": assessed.target,
        "comfort": assessed.comfort,
        "potential": {"start": found.potential[0].item(), "end": found.potential[-1].item()},
        "requirements": [
            {
                "label": part.label,
                "kind": part.requirement.kind,
                "start": part.contributions[0].item(),
                "end": part.contributions[-1].item(),
                "earned": part.earned,
                "cost": part.cost,
                "held": part.fraction,
                "first_violation": part.first_violation,
                "met_from": part.met_from,
                "worst_margin": part.worst,
                "low": part.low,
                "high": part.high,
            }
            for part in found.parts
        ],
        "outside_ranges": dict(assessed.outside),
        "decided_at_start": assessed.decided_at_start,
        **({"notes": list(found.notes)} if found.notes else {}),
        "pictures": len(film.frames),
        "no_pictures_because": film.trouble or None,
        "written": [str(path) for path in written],
    }
    print_json(content)
