# ruff: noqa: RUF001
"""What is said about a text that does not follow the grammar.

`explain` gets the words of a statement up to the one that does not fit and returns the error with
the advice that fits best. The grammar is in `grammar.lark`; nothing here decides what is accepted.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from hprs.errors import Position, SpecSyntaxError, did_you_mean
from hprs.spec.vocabulary import CLASSES, FUNCTIONS, KEYWORDS, RESERVED, ROOTS, STATEMENTS

_EQUALITY = "abs(a - b) <= tolerance."
_WORDS_OF_OTHERS = (
    "if",
    "then",
    "else",
    "when",
    "while",
    "unless",
    "until",
    "implies",
    "xor",
    "is",
)
_PASTED = "It is not the plain sign it looks like; type it again."
_SYMBOLS: Mapping[str, str] = MappingProxyType(
    {
        "==": f"measured numbers are almost never equal, so there is no '=='. Write {_EQUALITY}",
        "!=": "there is no '!='. Write abs(a - b) >= tolerance.",
        "<>": "there is no '<>'. Write abs(a - b) >= tolerance.",
        "=<": "'=<' is written the other way round: '<='.",
        "=>": "'=>' is written the other way round: '>='. There is no implication; use `or`.",
        ":=": "':=' is not needed: a declaration uses '=', a requirement ':'.",
        "&": "'&' is Python's spelling. Write `and`.",
        "&&": "'&&' is C's spelling. Write `and`.",
        "|": "'|' is Python's spelling. Write `or`, or abs(x) for the absolute value.",
        "||": "'||' is C's spelling. Write `or`.",
        "^": "'^' is not a power here. Write `**`.",
        "//": "there is no '//' (a comment starts with '#'; a division is '/').",
        "!": "there is no '!'. Turn the comparison round: not (x <= 1) is x > 1.",
        "~": "there is no '~'. Turn the comparison round: not (x <= 1) is x > 1.",
        "not": "there is no `not`. Turn the comparison round: not (x <= 1) is x > 1.",
        "%": "there is no '%'. Write percentages as fractions: 5 % is 0.05.",
        ";": "there is no ';'. Put each statement on a line of its own.",
        "'": 'a unit stands in double quotes, as in "m/s".',
        '"': "the quotes of this unit are never closed on its line.",
        "{": "braces have no meaning here. Use parentheses, and brackets for ranges.",
        "}": "braces have no meaning here. Use parentheses, and brackets for ranges.",
        "≤": "'≤' is written <=.",
        "≥": "'≥' is written >=.",
        "≠": "there is no '≠'. Write abs(a - b) >= tolerance.",
        "°": "'°' is written deg, as in 12 deg.",
        "π": "'π' is written pi.",
        "∞": "'∞' is written inf.",
        "×": "'×' is written *.",
        "·": "'·' is written *.",
        "÷": "'÷' is written /.",
        "²": "'²' is written ** 2.",
        "³": "'³' is written ** 3.",
        "−": f"'−' is not the minus sign '-'. {_PASTED}",
        "–": f"'–' is not the minus sign '-'. {_PASTED}",
        "“": f"'“' is not the quote '\"'. {_PASTED}",
        "”": f"'”' is not the quote '\"'. {_PASTED}",
        "„": f"'„' is not the quote '\"'. {_PASTED}",
        "：": f"'：' is not the colon ':'. {_PASTED}",
    }
)


class Word(NamedTuple):
    """A piece of the text: a name, a keyword, a number, a unit, a sign or the end of the line."""

    text: str
    position: Position

    @property
    def is_name(self) -> bool:
        """Whether it is a name that may be declared or used."""
        return self.text.isidentifier() and self.text not in KEYWORDS

    @property
    def is_number(self) -> bool:
        """Whether it is a number."""
        return re.match(r"\.?[0-9]", self.text) is not None

    @property
    def is_keyword(self) -> bool:
        """Whether it is a keyword."""
        return self.text in KEYWORDS

    @property
    def is_unit(self) -> bool:
        """Whether it is a text in quotes."""
        return self.text.startswith('"')

    @property
    def is_end(self) -> bool:
        """Whether it is the end of the line."""
        return self.text == "\n"

    @property
    def ends_value(self) -> bool:
        """Whether a value may end here, so that an operator must follow."""
        return self.is_name or self.is_number or self.text == ")"

    @property
    def starts_value(self) -> bool:
        """Whether a value may start here."""
        return self.is_name or self.is_number or self.text == "("

    def __str__(self) -> str:
        """The word as shown in a message."""
        if self.is_end:
            return "the end of the line"
        return f"'{self.text}'" if len(self.text) <= 40 else f"'{self.text[:40]}...'"


def explain_symbol(symbol: str, position: Position) -> SpecSyntaxError:
    """The error for a character or an operator that the language does not have."""
    if symbol in _SYMBOLS:
        return SpecSyntaxError(_SYMBOLS[symbol], position)
    if symbol.isalpha():
        message = f"'{symbol}' cannot be part of a name: names use a to z, A to Z, digits and '_'."
    elif symbol.isprintable():
        message = f"the character '{symbol}' has no meaning here."
    else:
        message = f"the invisible character U+{ord(symbol):04X} has no meaning here; delete it."
    return SpecSyntaxError(message, position)


def explain(before: Sequence[Word], found: Word) -> SpecSyntaxError:
    """The error for a word that does not fit.

    Args:
        before: The words of the statement that fit.
        found: The one that does not.
    """
    rules = (_BY_KEYWORD[before[0].text], *_ANYWHERE) if before else (_start,)
    advice = next((text for rule in rules if (text := rule(before, found))), None)
    return SpecSyntaxError(advice or f"{found} has no meaning here.", found.position)


_Rule = Callable[[Sequence[Word], Word], str | None]


def _start(_: Sequence[Word], found: Word) -> str:
    if not found.is_name:
        return (
            f"{found} cannot start a statement. To continue an expression on the next line, put it "
            "in parentheses."
        )
    listed = f"{', '.join(STATEMENTS[:-1])} or {STATEMENTS[-1]}"
    advice = did_you_mean(found.text.lower(), STATEMENTS)
    return f"a statement starts with {listed}, not with {found}.{advice}"


def _requirement(before: Sequence[Word], found: Word) -> str | None:
    kind = before[0].text
    if len(before) == 1:
        if found.text in RESERVED:
            return f"{found} is a reserved word; choose another label."
        return f"'{kind}' needs a label: {kind} LABEL: CONDITION."
    label = before[1]
    if len(before) == 2:
        if found.is_end:
            return f"requirement {label} has no condition: {kind} {label.text}: CONDITION."
        if found.text == "=":
            return f"a label is followed by ':', not by '='. '=' declares names; {kind} does not."
        if label.text in FUNCTIONS or not (found.starts_value or found.text == "-"):
            return f"'{kind}' needs a label: {kind} LABEL: CONDITION."
        return f"put a colon after the label: {kind} {label.text}: CONDITION."
    if len(before) == 3 and found.is_end:
        return f"requirement {label} has no condition: {kind} {label.text}: CONDITION."
    if found.text == "=":
        return (
            f"'=' declares names and does not compare. Use <= or >=, or for equality: {_EQUALITY}"
        )
    if found.text == "in" and before[-1].ends_value:
        return "`in` belongs to declarations. For a range of values write LOW <= x <= HIGH."
    return None


def _declaration(before: Sequence[Word], found: Word) -> str | None:
    keyword = before[0].text
    if len(before) == 1:
        return _no_name(keyword, found)
    name = before[1]
    if len(before) == 2:
        if found.text == "[":
            return f"only signals state a length; {name} takes its own from its expression."
        if found.text == ":":
            return f"'{keyword}' declares with '=': {keyword} {name.text} = EXPRESSION."
        return f"{name} needs '=' and a value: {keyword} {name.text} = EXPRESSION."
    if found.text == "=":
        return "a declaration has one '='. Declare each name on a line of its own."
    if found.text == "in":
        return "a constant has no range; only signals and `let` have one."
    if found.is_unit:
        return "only signals have units."
    return _range(before, found)


def _signal(before: Sequence[Word], found: Word) -> str | None:
    if len(before) == 1:
        return _no_name("signal", found)
    name, last, texts = before[1], before[-1].text, [word.text for word in before]
    if "in" in texts:
        return _range(before, found) or (None if texts.count("]") == 0 else _signal_order(found))
    if "initially" in texts:
        return _no_range(name) if found.is_end and before[-1].ends_value else None
    if texts[2:3] == ["["] and "]" not in texts:
        return f"the length of {name} is a whole number, as in signal {name.text}[3]."
    if "=" in texts:
        return _source(name, last, found)
    if found.is_unit:
        return _no_range(name)
    return _no_range(name) if found.is_end else _signal_order(found)


def _source(name: Word, last: str, found: Word) -> str | None:
    if last == "=":
        return f"the source of signal {name} reads {', '.join(ROOTS)}, as in {ROOTS[0]}[0]."
    if last in ("[", "-", ":") or (last.isdigit() and found.text in (",", ":", "-")):
        return "a source has one index: a whole number or a slice such as 0:3, for the last axis."
    if last == "]" and found.text in ("[", "."):
        return "a source is a path of keys and then one index for the last axis: obs.pose[0]."
    if last == "." or found.text.startswith("."):
        return "an entry of a dictionary is written obs.key; read a component as obs[0]."
    if found.is_end or found.is_unit:
        return _no_range(name)
    if found.text in ("+", "-", "*", "/", "**", "("):
        return f"a source only reads. Compute with `let`, as in let NAME = 2 * {name.text}."
    return _signal_order(found)


def _range(before: Sequence[Word], found: Word) -> str | None:
    texts = [word.text for word in before]
    if "in" not in texts:
        return None
    inside = texts[texts.index("in") + 1 :]
    written = "a range is written in [LOW, HIGH]"
    if not inside:
        return f"{written}, with brackets."
    if "]" in inside or not (before[-1].ends_value or before[-1].text in ("[", ",")):
        return None
    if found.text in ("]", ":", ".") or (found.starts_value and before[-1].ends_value):
        return f"{written}, two ends with a comma between them."
    if found.text == "," and "," in inside:
        return f"{written}, with two ends."
    return None


def _preference(before: Sequence[Word], found: Word) -> str:
    if found.is_keyword and found.text != "over":
        return f"{found} is a reserved word and not the label of a requirement."
    if len(before) == 4:
        return "a preference ranks two requirements: prefer HIGHER over LOWER. Add a line per pair."
    return "a preference is written prefer HIGHER over LOWER, with two labels."


def _no_name(keyword: str, found: Word) -> str:
    if found.text in RESERVED:
        return f"{found} is a reserved word; choose another name."
    return f"'{keyword}' needs a name, found {found}."


def _no_range(name: Word) -> str:
    return f"signal {name} needs a range here: in [LOW, HIGH]."


def _signal_order(found: Word) -> str:
    return (
        f"{found} is out of place. A signal is written "
        'signal NAME[length] = SOURCE initially VALUE in [LOW, HIGH] "unit".'
    )


def _operand(before: Sequence[Word], found: Word) -> str | None:
    """Two values in a row."""
    last = before[-1]
    if not (last.ends_value and found.starts_value):
        return None
    if last.text in FUNCTIONS:
        return f"{last.text} is a function: write {last.text}(...)."
    if found.text in _WORDS_OF_OTHERS:
        return f"there is no {found} here: conditions are comparisons, joined by `and` and `or`."
    if last.is_number and found.text.startswith("_") and _touch(last, found):
        return f"a number has no separators: write {last.text}{found.text.replace('_', '')}."
    if last.is_number and found.is_name:
        return f"an operator is missing: write {last.text} * {found.text}."
    return f"an operator is missing between {last} and {found}."


def _touch(first: Word, second: Word) -> bool:
    ends = (first.position.line, first.position.column + first.position.width)
    return ends == (second.position.line, second.position.column)


def _sign(before: Sequence[Word], found: Word) -> str | None:
    """A sign that an expression cannot hold in this place."""
    last = before[-1]
    if found.text == "[":
        return "an expression cannot index. Declare the component as a signal of its own."
    if found.text == "." and last.text in ROOTS:
        return f"an expression cannot read {last.text}. Declare a signal that does."
    if found.is_unit:
        return "only signals have units, at the end of their line."
    if found.text == "+" and not last.ends_value:
        return "a value needs no '+' before it; drop the sign."
    if found.text == ")" and last.text == "(":
        if before[-2].is_name:
            return f"{before[-2].text}() needs an argument."
        return "there is nothing between these parentheses."
    if found.text == "," and last.ends_value:
        return "a comma stands only between the arguments of a function and the ends of a range."
    return None


def _missing(before: Sequence[Word], found: Word) -> str | None:
    """No value where one is needed."""
    last = before[-1]
    if last.ends_value:
        return None
    if found.is_keyword:
        return f"a value is missing after {last}; {found} is a reserved word."
    return f"a value is missing after {last}, found {found}."


_ANYWHERE: tuple[_Rule, ...] = (_operand, _sign, _missing)
_BY_KEYWORD: Mapping[str, _Rule] = MappingProxyType(
    {
        "signal": _signal,
        "const": _declaration,
        "let": _declaration,
        "prefer": _preference,
        **dict.fromkeys(CLASSES, _requirement),
    }
)
