"""Writes an explanation as one HTML page that needs nothing else, and no network.

The page's text and script are `page.html`; the episode is data in it. Nothing of a user's text is
ever markup: the script writes it as text, and the data cannot close the element that holds it.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Iterable, Sequence
from importlib.resources import files
from typing import Any

import numpy as np

from hprs.explanation.explanation import Explanation, Numbers, Part
from hprs.explanation.film import Film
from hprs.explanation.outline import Outline, axis, outline
from hprs.explanation.palette import colours, failing
from hprs.explanation.wording import bound, judgement, summary, verdict
from hprs.spec.printer import format_task
from hprs.training.page_data import filled

_DIGITS = 9
"""Significant ones of the numbers in a page."""
_LARGEST = 1e308
"""What stands for infinity, which JSON does not know."""


def page(explanation: Explanation, film: Film) -> str:
    """The explanation as an HTML page."""
    template = files("hprs.explanation").joinpath("page.html").read_text(encoding="utf-8")
    return filled(template, explanation.title, content(explanation, film))


def content(explanation: Explanation, film: Film) -> dict[str, Any]:
    """What the page shows."""
    drawn = outline(explanation)
    found, stops = explanation.assessment, drawn.stops
    firsts = {kind: explanation.first_violation(kind) for kind in ("safety", "comfort")}
    return {
        "title": explanation.title,
        "summary": summary(explanation),
        "notes": list(_notes(explanation, drawn, film)),
        "steps": explanation.steps,
        "rate": explanation.rate,
        "pam": found.pam,
        "safe": bool(found.safe),
        "target": bool(found.target),
        "comfort": found.comfort,
        "violations": {
            kind: None if part is None else {"label": part.label, "step": part.first_violation}
            for kind, part in firsts.items()
        },
        "exact": drawn.is_exact,
        "stops": stops.tolist(),
        "starts": [] if drawn.is_exact else drawn.starts.tolist(),
        "potential": _numbers(explanation.potential[stops]),
        "shaping": _numbers(explanation.shaping[stops]),
        "base": _numbers(explanation.base[stops]),
        "parts": [
            _part(explanation, part, drawn, colour)
            for part, colour in zip(explanation.parts, colours(explanation.parts), strict=True)
        ],
        "format": film.stock.format,
        "frames": [
            [frame.step, base64.b64encode(frame.data).decode("ascii")] for frame in film.frames
        ],
        "task": format_task(explanation.task),
    }


def _part(explanation: Explanation, part: Part, drawn: Outline, colour: str) -> dict[str, Any]:
    stops, scale = drawn.stops, axis(part)
    shown = {
        "label": part.label,
        "kind": part.requirement.kind,
        "target": part.is_target,
        "predicate": part.predicate,
        "colour": colour,
        "failing": failing(part),
        "low": _finite(part.low),
        "high": _finite(part.high),
        "bounds": [bound(part.low), bound(part.high)],
        "bottom": scale.bottom,
        "top": scale.top,
        "verdict": verdict(explanation, part),
        "judgement": judgement(part),
        "at": part.met_from if part.is_target else part.first_violation,
        "violated": drawn.violated(part),
        "margins": _numbers(part.margins[stops]),
        "scores": _numbers(part.scores[stops]),
        "contributions": _numbers(part.contributions[stops]),
        "changes": _numbers(part.changes[stops]),
        "holds": part.satisfied[stops].astype(int).tolist(),
    }
    if not drawn.is_exact:
        shown["least"] = _numbers(drawn.least(part.margins))
        shown["greatest"] = _numbers(drawn.greatest(part.margins))
    return shown


def _notes(explanation: Explanation, drawn: Outline, film: Film) -> Iterable[str]:
    if not drawn.is_exact:
        yield (
            f"The episode has {drawn.states:,} states. The margins' bands run from the least to "
            f"the greatest value of every {drawn.length:,} states; the cursor stops at "
            f"{len(drawn.stops):,} of them, the highest and lowest potentials, worst margins and "
            "first violations included."
        )
    if film.trouble:
        yield f"{'No' if not film.frames else 'No more'} pictures: {film.trouble}"
    elif film.every > 1:
        yield f"There is a picture of every {_ordinal(film.every)} step, to keep the page small."
    for name, count in explanation.assessment.outside.items():
        yield f"Signal '{name}' left its range in {count:,} of {drawn.states:,} states."
    if explanation.assessment.decided_at_start:
        yield "The first state decided this episode already."
    yield from explanation.notes


def _ordinal(number: int) -> str:
    """Of a power of two from 2 on."""
    return {2: "2nd", 32: "32nd"}.get(number, f"{number}th")


def _numbers(values: Numbers | Sequence[float]) -> list[float]:
    return [_number(float(value)) for value in np.asarray(values)]


def _number(value: float) -> float:
    if not math.isfinite(value):
        return math.copysign(_LARGEST, value)
    return float(f"{value:.{_DIGITS}g}")


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
