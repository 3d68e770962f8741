# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# (lark annotates only parts of what is used here.)
"""From the text of a task to a `Task`, and nothing of the text is ever executed.

The parse tree is never built: lark's LALR parser calls
`_Builder` at each reduction, so that nothing recurses on what a user wrote.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from typing import TypeAlias, cast

from lark import Lark, Token, Transformer, v_args
from lark.exceptions import UnexpectedToken

from hprs.errors import Position, SpecError, SpecSyntaxError
from hprs.spec.expression import (
    And,
    Binary,
    BinaryOperator,
    Call,
    Comparison,
    Expression,
    Name,
    Negate,
    Number,
    Or,
    Predicate,
    Relation,
)
from hprs.spec.grammar import load_grammar
from hprs.spec.statements import Constant, Definition, Preference, Requirement, Signal, Source
from hprs.spec.task import Task
from hprs.spec.task_file import normalised, read_text
from hprs.spec.vocabulary import KEYWORDS, STATEMENTS, Kind

MAX_WORDS = 20_000
"""Most words, numbers and signs in a text."""
MAX_BRACKETS = 200
"""Deepest nesting of brackets; a printed expression of depth `MAX_DEPTH` stays below it."""
MAX_DIGITS = 400
"""Longest number, in characters."""
MAX_NAME = 100
"""Longest name, in characters."""

_Value: TypeAlias = Expression | Predicate
_Slice: TypeAlias = tuple[int | None, int | None]
_Statement: TypeAlias = Signal | Constant | Definition | Requirement | Preference

_CLOSER = {"(": ")", "[": "]"}


def load_task(path: str | os.PathLike[str]) -> Task:
    """Read a task from a file.

    Raises:
        SpecError: The file cannot be read, or is not a task.
    """
    return parse_task(read_text(path), path=os.fspath(path))


def parse_task(text: str, *, path: str | None = None) -> Task:
    """Build a task from its text.

    Args:
        text: The task.
        path: Where the text came from, for messages.

    Raises:
        SpecSyntaxError: The text does not follow the grammar.
        SpecValidationError: What it says cannot be meant; see `Task`.
    """
    try:
        text = normalised(text)
        return _parse(text)
    except SpecError as error:
        error.text, error.path = error.text or text, path
        raise


def _parse(text: str) -> Task:
    session = _lark().parse_interactive(text)
    statement: list[Token] = []
    for token in _filtered(session.lexer_thread.lex(session.parser_state)):
        try:
            session.feed_token(token)
        except UnexpectedToken:
            raise _mistake(statement, token) from None
        if token.type == "_NEWLINE":
            statement.clear()
        else:
            statement.append(token)
    return cast(Task, session.feed_eof())


@cache
def _lark() -> Lark:
    return load_grammar(_Builder())


def _filtered(tokens: Iterable[Token]) -> Iterator[Token]:
    """Drop newlines inside brackets and blank lines; end the last line; refuse bad words."""
    opened: list[Token] = []
    last: Token | None = None
    for count, token in enumerate(tokens):
        if count == MAX_WORDS:
            raise SpecSyntaxError(
                f"a task may have {MAX_WORDS} words and signs, and this one has more.", _at(token)
            )
        if token.type == "_NEWLINE":
            if opened or last is None or last.type == "_NEWLINE":
                continue
            token = _end_of_line(last)
        else:
            token = _checked(token, last, opened)
        yield token
        last = token
    if opened:
        raise _unclosed(opened[-1])
    if last is not None and last.type != "_NEWLINE":
        yield _end_of_line(last)


def _checked(token: Token, last: Token | None, opened: list[Token]) -> Token:
    """The token, with the brackets that are open after it."""
    check = _CHECKS.get(token.type)
    if check is not None:
        check(token, opened)
    elif last is not None and last.type == "DOT" and token in KEYWORDS:
        return Token.new_borrow_pos("NAME", token, token)
    elif opened and token in STATEMENTS:
        raise _unclosed(opened[-1])
    return token


def _refuse(token: Token, _: list[Token]) -> None:
    from hprs.spec.mistakes import explain_symbol

    raise explain_symbol(str(token), _at(token))


def _check_name(token: Token, _: list[Token]) -> None:
    if len(token) > MAX_NAME:
        raise SpecSyntaxError(
            f"a name may have {MAX_NAME} characters, and this one has {len(token)}.", _at(token)
        )


def _check_number(token: Token, _: list[Token]) -> None:
    if len(token) > MAX_DIGITS:
        raise SpecSyntaxError(
            f"a number may have {MAX_DIGITS} digits, and this one has {len(token)}.", _at(token)
        )


def _open(token: Token, opened: list[Token]) -> None:
    opened.append(token)
    if len(opened) > MAX_BRACKETS:
        raise SpecSyntaxError(
            f"brackets are nested deeper than {MAX_BRACKETS} levels. "
            "Give the parts names with `let`.",
            _at(token),
        )


def _close(token: Token, opened: list[Token]) -> None:
    if not opened:
        raise SpecSyntaxError(f"this '{token}' closes nothing.", _at(token))
    opener = opened.pop()
    if _CLOSER[opener] != token:
        raise SpecSyntaxError(
            f"this '{token}' closes the '{opener}' of line {opener.line}, column {opener.column}, "
            f"which needs a '{_CLOSER[opener]}'.",
            _at(token),
        )


# A table, not a chain of comparisons: lark's names of token kinds compare slowly.
_CHECKS: Mapping[str, Callable[[Token, list[Token]], None]] = {
    "MISTAKE": _refuse,
    "UNKNOWN": _refuse,
    "NAME": _check_name,
    "NUMBER": _check_number,
    "LPAR": _open,
    "LSQB": _open,
    "CLOSE": _close,
    "RSQB": _close,
}


def _unclosed(opener: Token) -> SpecSyntaxError:
    return SpecSyntaxError(f"this '{opener}' is never closed.", _at(opener))


def _end_of_line(last: Token) -> Token:
    return Token("_NEWLINE", "\n", line=last.end_line, column=last.end_column)


def _at(token: Token) -> Position:
    return Position(token.line or 1, token.column or 1, len(token))


def _mistake(statement: Sequence[Token], found: Token) -> SpecSyntaxError:
    # Its many messages are loaded when one is needed.
    from hprs.spec.mistakes import Word, explain

    *before, last = (Word(str(token), _at(token)) for token in (*statement, found))
    return explain(before, last)


def _span(first: Position | None, last: Position | None) -> Position | None:
    """From the first to the last place if one line holds both, else the first."""
    if first is None or last is None or first.line != last.line:
        return first
    return Position(first.line, first.column, last.column + last.width - first.column)


def _number(value: _Value) -> Expression:
    """The value, which must be a number and not a condition."""
    if isinstance(value, Comparison | And | Or):
        raise SpecSyntaxError("this is a condition, and a number is needed here.", value.position)
    return value


def _condition(value: _Value, context: str) -> Predicate:
    """The value, which must be a condition and not a number."""
    if isinstance(value, Comparison | And | Or):
        return value
    raise SpecSyntaxError(
        f"{context} a comparison such as x <= 1, and this is only a number.", value.position
    )


def _whole(token: Token, sign: Token | None = None) -> int:
    if not (token.isdigit() and len(token) <= 9):
        raise SpecSyntaxError(f"'{token[:40]}' is not a whole number below 10 ** 9.", _at(token))
    return -int(token) if sign else int(token)


@v_args(inline=True)
class _Builder(Transformer[Token, Task]):
    """Builds the task, one method per rule of the grammar."""

    def start(self, *statements: _Statement) -> Task:
        """Sort the statements by kind."""
        return Task(
            signals=tuple(s for s in statements if isinstance(s, Signal)),
            requirements=tuple(s for s in statements if isinstance(s, Requirement)),
            constants=tuple(s for s in statements if isinstance(s, Constant)),
            definitions=tuple(s for s in statements if isinstance(s, Definition)),
            preferences=tuple(s for s in statements if isinstance(s, Preference)),
        )

    def signal(
        self,
        name: Token,
        length: int | None,
        source: Source | None,
        initially: Expression | None,
        ends: tuple[Expression, Expression],
        unit: Token | None,
    ) -> Signal:
        return Signal(
            str(name),
            *ends,
            source=source,
            length=length,
            initially=initially,
            unit="" if unit is None else unit[1:-1],
            position=_at(name),
        )

    def length(self, digits: Token | None) -> int | None:
        return None if digits is None else _whole(digits)

    def source(self, root: Token, *rest: Token | int | _Slice) -> Source:
        keys = tuple(str(part) for part in rest if isinstance(part, Token))
        index = next((part for part in rest if not isinstance(part, Token)), None)
        return Source(str(root), keys, index, position=_at(root))

    def component(self, index: int) -> int:
        return index

    def slice(self, start: int | None, stop: int | None) -> _Slice:
        return (start, stop)

    def integer(self, sign: Token | None, digits: Token) -> int:
        return _whole(digits, sign)

    def initially(self, value: _Value | None) -> Expression | None:
        return None if value is None else _number(value)

    def range(self, low: _Value, high: _Value) -> tuple[Expression, Expression]:
        return (_number(low), _number(high))

    def constant(self, name: Token, value: _Value) -> Constant:
        return Constant(str(name), _number(value), position=_at(name))

    def definition(
        self, name: Token, value: _Value, ends: tuple[Expression, Expression] | None
    ) -> Definition:
        low, high = ends or (None, None)
        return Definition(str(name), _number(value), low, high, position=_at(name))

    def requirement(self, kind: Token, label: Token, _: Token, value: _Value) -> Requirement:
        predicate = _condition(value, f"requirement '{label}' needs")
        return Requirement(cast(Kind, str(kind)), str(label), predicate, position=_at(label))

    def preference(self, prefer: Token, higher: Token, lower: Token) -> Preference:
        return Preference(str(higher), str(lower), position=_span(_at(prefer), _at(lower)))

    def disjunction(self, *parts: _Value) -> Or:
        conditions = tuple(_condition(part, "each side of `or` needs") for part in parts)
        return Or(conditions, position=_span(parts[0].position, parts[-1].position))

    def conjunction(self, *parts: _Value) -> And:
        conditions = tuple(_condition(part, "each side of `and` needs") for part in parts)
        return And(conditions, position=_span(parts[0].position, parts[-1].position))

    def comparison(self, *parts: _Value | Token) -> Predicate:
        sides = [_number(cast(_Value, part)) for part in parts[::2]]
        leaves = tuple(
            Comparison(
                left,
                cast(Relation, str(relation)),
                right,
                position=_span(left.position, right.position),
            )
            for left, relation, right in zip(sides, parts[1::2], sides[1:], strict=False)
        )
        if len(leaves) == 1:
            return leaves[0]
        return And(leaves, position=_span(sides[0].position, sides[-1].position))

    def binary(self, left: _Value, operator: Token, right: _Value) -> Binary:
        position = _span(left.position, right.position)
        return Binary(
            cast(BinaryOperator, str(operator)), _number(left), _number(right), position=position
        )

    def negation(self, minus: Token, operand: _Value) -> Negate:
        return Negate(_number(operand), position=_span(_at(minus), operand.position))

    def number(self, token: Token) -> Number:
        value = float(token)
        if value == float("inf"):
            raise SpecSyntaxError(
                "this number is too large; the largest is about 1.8e308.", _at(token)
            )
        if value == 0.0 and token.lower().partition("e")[0].strip("0."):
            raise SpecSyntaxError(
                "this number is too small to tell from 0; the smallest is about 4.9e-324.",
                _at(token),
            )
        return Number(value, position=_at(token))

    def degrees(self, token: Token, deg: Token) -> Binary:
        return self.binary(self.number(token), Token("STAR", "*"), self.name(deg))

    def name(self, token: Token) -> Name:
        return Name(str(token), position=_at(token))

    def call(self, function: Token, *rest: _Value | Token) -> Call:
        *arguments, close = rest
        return Call(
            str(function),
            tuple(_number(cast(_Value, argument)) for argument in arguments),
            position=_span(_at(function), _at(cast(Token, close))),
        )
