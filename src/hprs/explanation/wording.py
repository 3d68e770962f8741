"""The words and numbers that terminal, picture and page share."""

from __future__ import annotations

from hprs.explanation.explanation import Explanation, Part


def summary(explanation: Explanation) -> str:
    """Length and assessment of an episode in one line."""
    found, rate = explanation.assessment, explanation.rate
    time = f" ({explanation.steps / rate:.2f} s)" if rate else ""
    return (
        f"{explanation.steps:,} step{'' if explanation.steps == 1 else 's'}{time}, "
        f"PAM {found.pam:.3f}: {'safe' if found.safe else 'not safe'}, "
        f"{'on target' if found.target else 'not on target'}, comfort {found.comfort:.3f}"
    )


def verdict(explanation: Explanation, part: Part) -> str:
    """Since when a target counts as met, or when another requirement was violated first."""
    if part.is_target:
        met = part.met_from
        return "not met" if met is None else f"met from {explanation.moment(met)}"
    violated = part.first_violation
    return "never violated" if violated is None else f"violated at {explanation.moment(violated)}"


def judgement(part: Part) -> str:
    """What a requirement earned and cost, and how often it held."""
    return f"earned {change(part.earned)}, cost {change(part.cost)}, held {percent(part.fraction)}"


def percent(fraction: float) -> str:
    """A fraction; what is not all or nothing does not look so."""
    if 0.9995 <= fraction < 1.0:
        return ">99.9%"
    return "<0.1%" if 0.0 < fraction < 0.0005 else f"{fraction:.1%}"


def number(value: float) -> str:
    """A margin, with three decimals where these say anything."""
    plain = value == 0.0 or 0.001 <= abs(value) < 1000
    return _signed(f"{value:.3f}" if plain else f"{value:.3g}")


def change(value: float) -> str:
    """A difference, with its sign."""
    return "0" if value == 0.0 else _signed(f"{value:+.3f}")


def bound(value: float) -> str:
    """An end of a margin's range."""
    return _signed(f"{value:.3g}")


def _signed(text: str) -> str:
    """A number with the minus sign of print, which is as wide as the plus sign."""
    return text.replace("-", "\N{MINUS SIGN}")
