"""Malformed tasks and what is said about each: documentation and test in one table.

`python tests/spec/malformed.py > docs/errors.md` writes the page; a test compares the two.
"""

# ruff: noqa: RUF001

from __future__ import annotations

import sys
from dataclasses import dataclass


@dataclass(frozen=True)
class Malformed:
    """A text that is not a task, and the exact message it gets when read from `task.hprs`."""

    title: str
    text: str
    message: str


MALFORMED: dict[str, tuple[Malformed, ...]] = {
    "Statements": (
        Malformed(
            "An unknown keyword",
            "ensures safe: x <= 1",
            (
                "task.hprs:1:1: a statement starts with signal, const, let, ensure, achieve, conquer, encourage or prefer, not with 'ensures'. Did you mean 'ensure'?\n"
                "    1 | ensures safe: x <= 1\n"
                "      | ^^^^^^^"
            ),
        ),
        Malformed(
            "A keyword in capitals",
            "ENSURE safe: x <= 1",
            (
                "task.hprs:1:1: a statement starts with signal, const, let, ensure, achieve, conquer, encourage or prefer, not with 'ENSURE'. Did you mean 'ensure'?\n"
                "    1 | ENSURE safe: x <= 1\n"
                "      | ^^^^^^"
            ),
        ),
        Malformed(
            "A formula where a statement belongs",
            "x <= 1",
            (
                "task.hprs:1:1: a statement starts with signal, const, let, ensure, achieve, conquer, encourage or prefer, not with 'x'.\n"
                "    1 | x <= 1\n"
                "      | ^"
            ),
        ),
        Malformed(
            "An expression continued without parentheses",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x <= 1\n  and y <= 1"),
            (
                "task.hprs:4:3: 'and' cannot start a statement. To continue an expression on the next line, put it in parentheses.\n"
                "    4 |   and y <= 1\n"
                "      |   ^^^"
            ),
        ),
        Malformed(
            "Two statements on one line",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure low: x <= 1; ensure high: x >= -1"),
            (
                "task.hprs:3:19: there is no ';'. Put each statement on a line of its own.\n"
                "    3 | ensure low: x <= 1; ensure high: x >= -1\n"
                "      |                   ^"
            ),
        ),
        Malformed(
            "An unknown sign",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x <= 1 ?"),
            (
                "task.hprs:3:21: the character '?' has no meaning here.\n"
                "    3 | ensure safe: x <= 1 ?\n"
                "      |                     ^"
            ),
        ),
        Malformed(
            "Other brackets",
            "signal x in {0, 1}",
            (
                "task.hprs:1:13: braces have no meaning here. Use parentheses, and brackets for ranges.\n"
                "    1 | signal x in {0, 1}\n"
                "      |             ^"
            ),
        ),
    ),
    "Requirements": (
        Malformed(
            "No label",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure x <= 1"),
            (
                "task.hprs:3:10: 'ensure' needs a label: ensure LABEL: CONDITION.\n"
                "    3 | ensure x <= 1\n"
                "      |          ^^"
            ),
        ),
        Malformed(
            "A number as label",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure 1: x <= 1"),
            (
                "task.hprs:3:8: 'ensure' needs a label: ensure LABEL: CONDITION.\n"
                "    3 | ensure 1: x <= 1\n"
                "      |        ^"
            ),
        ),
        Malformed(
            "No label before a function",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure abs(x) <= 1"),
            (
                "task.hprs:3:11: 'ensure' needs a label: ensure LABEL: CONDITION.\n"
                "    3 | ensure abs(x) <= 1\n"
                "      |           ^"
            ),
        ),
        Malformed(
            "No colon",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe x <= 1"),
            (
                "task.hprs:3:13: put a colon after the label: ensure safe: CONDITION.\n"
                "    3 | ensure safe x <= 1\n"
                "      |             ^"
            ),
        ),
        Malformed(
            "An equals sign for the colon",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe = x <= 1"),
            (
                "task.hprs:3:13: a label is followed by ':', not by '='. '=' declares names; ensure does not.\n"
                "    3 | ensure safe = x <= 1\n"
                "      |             ^"
            ),
        ),
        Malformed(
            "A keyword as label",
            "ensure in: x <= 1",
            (
                "task.hprs:1:8: 'in' is a reserved word; choose another label.\n"
                "    1 | ensure in: x <= 1\n"
                "      |        ^^"
            ),
        ),
        Malformed(
            "A label and nothing else",
            "ensure safe",
            (
                "task.hprs:1:12: requirement 'safe' has no condition: ensure safe: CONDITION.\n"
                "    1 | ensure safe\n"
                "      |            ^"
            ),
        ),
        Malformed(
            "No condition",
            "ensure safe:",
            (
                "task.hprs:1:13: requirement 'safe' has no condition: ensure safe: CONDITION.\n"
                "    1 | ensure safe:\n"
                "      |             ^"
            ),
        ),
        Malformed(
            "A number where a condition belongs",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: abs(x)"),
            (
                "task.hprs:3:14: requirement 'safe' needs a comparison such as x <= 1, and this is only a number.\n"
                "    3 | ensure safe: abs(x)\n"
                "      |              ^^^^^^"
            ),
        ),
        Malformed(
            "Membership in a range",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x in [0, 1]"),
            (
                "task.hprs:3:16: `in` belongs to declarations. For a range of values write LOW <= x <= HIGH.\n"
                "    3 | ensure safe: x in [0, 1]\n"
                "      |                ^^"
            ),
        ),
        Malformed(
            "A unit in a condition",
            ('signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x <= 1 "m"'),
            (
                "task.hprs:3:21: only signals have units, at the end of their line.\n"
                '    3 | ensure safe: x <= 1 "m"\n'
                "      |                     ^^^"
            ),
        ),
        Malformed(
            "A label used twice",
            (
                "signal x in [-5, 5]\n"
                "signal y in [0, 1]\n"
                "ensure safe: x <= 1\n"
                "encourage safe: y <= 0.5"
            ),
            (
                "task.hprs:4:11: 'safe' is declared twice; signals, constants, definitions and requirements share one namespace.\n"
                "    4 | encourage safe: y <= 0.5\n"
                "      |           ^^^^"
            ),
        ),
        Malformed(
            "A label that is also a signal",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure x: x <= 1"),
            (
                "task.hprs:3:8: 'x' is declared twice; signals, constants, definitions and requirements share one namespace.\n"
                "    3 | ensure x: x <= 1\n"
                "      |        ^"
            ),
        ),
        Malformed(
            "Two targets",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nachieve a: x <= 1\nconquer b: y <= 0.5"),
            (
                "task.hprs:4:9: a task has one target, but 'a' and 'b' are two. Join their conditions with `and`.\n"
                "    4 | conquer b: y <= 0.5\n"
                "      |         ^"
            ),
        ),
    ),
    "Comparisons and logic": (
        Malformed(
            "Equality",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nconquer parked: x == 1"),
            (
                "task.hprs:3:19: measured numbers are almost never equal, so there is no '=='. Write abs(a - b) <= tolerance.\n"
                "    3 | conquer parked: x == 1\n"
                "      |                   ^^"
            ),
        ),
        Malformed(
            "Inequality",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure moved: x != 0"),
            (
                "task.hprs:3:17: there is no '!='. Write abs(a - b) >= tolerance.\n"
                "    3 | ensure moved: x != 0\n"
                "      |                 ^^"
            ),
        ),
        Malformed(
            "A single equals sign",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nconquer parked: x = 1"),
            (
                "task.hprs:3:19: '=' declares names and does not compare. Use <= or >=, or for equality: abs(a - b) <= tolerance.\n"
                "    3 | conquer parked: x = 1\n"
                "      |                   ^"
            ),
        ),
        Malformed(
            "A relation written backwards",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x =< 1"),
            (
                "task.hprs:3:16: '=<' is written the other way round: '<='.\n"
                "    3 | ensure safe: x =< 1\n"
                "      |                ^^"
            ),
        ),
        Malformed(
            "An implication",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x >= 0 => y >= 0"),
            (
                "task.hprs:3:21: '=>' is written the other way round: '>='. There is no implication; use `or`.\n"
                "    3 | ensure safe: x >= 0 => y >= 0\n"
                "      |                     ^^"
            ),
        ),
        Malformed(
            "Negation",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: not x <= 1"),
            (
                "task.hprs:3:14: there is no `not`. Turn the comparison round: not (x <= 1) is x > 1.\n"
                "    3 | ensure safe: not x <= 1\n"
                "      |              ^^^"
            ),
        ),
        Malformed(
            "Negation in C",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: !(x <= 1)"),
            (
                "task.hprs:3:14: there is no '!'. Turn the comparison round: not (x <= 1) is x > 1.\n"
                "    3 | ensure safe: !(x <= 1)\n"
                "      |              ^"
            ),
        ),
        Malformed(
            "Conjunction in Python's operators",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: (x <= 1) & (y <= 1)"),
            (
                "task.hprs:3:23: '&' is Python's spelling. Write `and`.\n"
                "    3 | ensure safe: (x <= 1) & (y <= 1)\n"
                "      |                       ^"
            ),
        ),
        Malformed(
            "Conjunction in C",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x <= 1 && y <= 1"),
            (
                "task.hprs:3:21: '&&' is C's spelling. Write `and`.\n"
                "    3 | ensure safe: x <= 1 && y <= 1\n"
                "      |                     ^^"
            ),
        ),
        Malformed(
            "Bars for the absolute value",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: |x| <= 1"),
            (
                "task.hprs:3:14: '|' is Python's spelling. Write `or`, or abs(x) for the absolute value.\n"
                "    3 | ensure safe: |x| <= 1\n"
                "      |              ^"
            ),
        ),
        Malformed(
            "Disjunction in C",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x <= 1 || y <= 1"),
            (
                "task.hprs:3:21: '||' is C's spelling. Write `or`.\n"
                "    3 | ensure safe: x <= 1 || y <= 1\n"
                "      |                     ^^"
            ),
        ),
        Malformed(
            "A compared condition",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: (x <= 1) <= 1"),
            (
                "task.hprs:3:15: this is a condition, and a number is needed here.\n"
                "    3 | ensure safe: (x <= 1) <= 1\n"
                "      |               ^^^^^^"
            ),
        ),
        Malformed(
            "A number joined with `and`",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x <= 1 and y"),
            (
                "task.hprs:3:25: each side of `and` needs a comparison such as x <= 1, and this is only a number.\n"
                "    3 | ensure safe: x <= 1 and y\n"
                "      |                         ^"
            ),
        ),
        Malformed(
            "A number joined with `or`",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: y or x <= 1"),
            (
                "task.hprs:3:14: each side of `or` needs a comparison such as x <= 1, and this is only a number.\n"
                "    3 | ensure safe: y or x <= 1\n"
                "      |              ^"
            ),
        ),
        Malformed(
            "A condition inside a function",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: max(x <= 1, y <= 1) > 0"),
            (
                "task.hprs:3:18: this is a condition, and a number is needed here.\n"
                "    3 | ensure safe: max(x <= 1, y <= 1) > 0\n"
                "      |                  ^^^^^^"
            ),
        ),
        Malformed(
            "A condition in arithmetic",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: 2 * (x <= 1)"),
            (
                "task.hprs:3:19: this is a condition, and a number is needed here.\n"
                "    3 | ensure safe: 2 * (x <= 1)\n"
                "      |                   ^^^^^^"
            ),
        ),
        Malformed(
            "A second colon",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x <= 1: y <= 1"),
            (
                "task.hprs:3:20: ':' has no meaning here.\n"
                "    3 | ensure safe: x <= 1: y <= 1\n"
                "      |                    ^"
            ),
        ),
        Malformed(
            "A condition given a name",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nlet near = abs(x) <= 1"),
            (
                "task.hprs:3:12: this is a condition, and a number is needed here.\n"
                "    3 | let near = abs(x) <= 1\n"
                "      |            ^^^^^^^^^^^"
            ),
        ),
        Malformed(
            "A relation without its right side",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x <="),
            (
                "task.hprs:3:18: a value is missing after '<=', found the end of the line.\n"
                "    3 | ensure safe: x <=\n"
                "      |                  ^"
            ),
        ),
        Malformed(
            "A doubled relation",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x <= < 1"),
            (
                "task.hprs:3:19: a value is missing after '<=', found '<'.\n"
                "    3 | ensure safe: x <= < 1\n"
                "      |                   ^"
            ),
        ),
    ),
    "Expressions": (
        Malformed(
            "No operator between number and name",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: 2 x <= 1"),
            (
                "task.hprs:3:16: an operator is missing: write 2 * x.\n"
                "    3 | ensure safe: 2 x <= 1\n"
                "      |                ^"
            ),
        ),
        Malformed(
            "No operator between names",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x y <= 1"),
            (
                "task.hprs:3:16: an operator is missing between 'x' and 'y'.\n"
                "    3 | ensure safe: x y <= 1\n"
                "      |                ^"
            ),
        ),
        Malformed(
            "A function without parentheses",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: abs x <= 1"),
            (
                "task.hprs:3:18: abs is a function: write abs(...).\n"
                "    3 | ensure safe: abs x <= 1\n"
                "      |                  ^"
            ),
        ),
        Malformed(
            "A function without arguments",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: abs() <= 1"),
            (
                "task.hprs:3:18: abs() needs an argument.\n"
                "    3 | ensure safe: abs() <= 1\n"
                "      |                  ^"
            ),
        ),
        Malformed(
            "Empty parentheses",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: () <= 1"),
            (
                "task.hprs:3:15: there is nothing between these parentheses.\n"
                "    3 | ensure safe: () <= 1\n"
                "      |               ^"
            ),
        ),
        Malformed(
            "Too many arguments",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: sqrt(y, 2) <= 1"),
            (
                "task.hprs:3:14: sqrt() takes 1 argument, got 2.\n"
                "    3 | ensure safe: sqrt(y, 2) <= 1\n"
                "      |              ^^^^^^^^^^"
            ),
        ),
        Malformed(
            "Too few arguments",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: clip(x, 1) <= 1"),
            (
                "task.hprs:3:14: clip() takes 3 arguments, got 2.\n"
                "    3 | ensure safe: clip(x, 1) <= 1\n"
                "      |              ^^^^^^^^^^"
            ),
        ),
        Malformed(
            "An unknown function",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: absolute(x) <= 1"),
            (
                "task.hprs:3:14: unknown function 'absolute'. Functions are abs, min, max, sum, mean, norm, clip, sqrt, exp, log, sin, cos, tan, atan2, hypot, sign.\n"
                "    3 | ensure safe: absolute(x) <= 1\n"
                "      |              ^^^^^^^^^^^"
            ),
        ),
        Malformed(
            "A function without its argument",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: abs <= 1"),
            (
                "task.hprs:3:14: abs is a function: write abs(...).\n"
                "    3 | ensure safe: abs <= 1\n"
                "      |              ^^^"
            ),
        ),
        Malformed(
            "A condition on a condition",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x <= .5 if y <= 0.2"),
            (
                "task.hprs:3:22: there is no 'if' here: conditions are comparisons, joined by `and` and `or`.\n"
                "    3 | ensure safe: x <= .5 if y <= 0.2\n"
                "      |                      ^^"
            ),
        ),
        Malformed(
            "A caret for the power",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x ^ 2 <= 1"),
            (
                "task.hprs:3:16: '^' is not a power here. Write `**`.\n"
                "    3 | ensure safe: x ^ 2 <= 1\n"
                "      |                ^"
            ),
        ),
        Malformed(
            "Integer division",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x // 2 <= 1"),
            (
                "task.hprs:3:16: there is no '//' (a comment starts with '#'; a division is '/').\n"
                "    3 | ensure safe: x // 2 <= 1\n"
                "      |                ^^"
            ),
        ),
        Malformed(
            "A percentage",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: y <= 5 %"),
            (
                "task.hprs:3:21: there is no '%'. Write percentages as fractions: 5 % is 0.05.\n"
                "    3 | ensure safe: y <= 5 %\n"
                "      |                     ^"
            ),
        ),
        Malformed(
            "A plus sign before a value",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x <= +1"),
            (
                "task.hprs:3:19: a value needs no '+' before it; drop the sign.\n"
                "    3 | ensure safe: x <= +1\n"
                "      |                   ^"
            ),
        ),
        Malformed(
            "A missing operand",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x + <= 1"),
            (
                "task.hprs:3:18: a value is missing after '+', found '<='.\n"
                "    3 | ensure safe: x + <= 1\n"
                "      |                  ^^"
            ),
        ),
        Malformed(
            "A keyword in an expression",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x + in <= 1"),
            (
                "task.hprs:3:18: a value is missing after '+'; 'in' is a reserved word.\n"
                "    3 | ensure safe: x + in <= 1\n"
                "      |                  ^^"
            ),
        ),
        Malformed(
            "Indexing a signal",
            ("signal v[3] in [0, 1]\nensure safe: v[0] <= 1"),
            (
                "task.hprs:2:15: an expression cannot index. Declare the component as a signal of its own.\n"
                "    2 | ensure safe: v[0] <= 1\n"
                "      |               ^"
            ),
        ),
        Malformed(
            "Reading the observation",
            "ensure safe: obs.speed <= 1",
            (
                "task.hprs:1:17: an expression cannot read obs. Declare a signal that does.\n"
                "    1 | ensure safe: obs.speed <= 1\n"
                "      |                 ^"
            ),
        ),
        Malformed(
            "A stray comma",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: (x, y) <= 1"),
            (
                "task.hprs:3:16: a comma stands only between the arguments of a function and the ends of a range.\n"
                "    3 | ensure safe: (x, y) <= 1\n"
                "      |                ^"
            ),
        ),
        Malformed(
            "An unclosed parenthesis",
            (
                "signal x in [-5, 5]\n"
                "signal y in [0, 1]\n"
                "ensure safe: abs(x <= 1\n"
                "ensure calm: y <= 1"
            ),
            (
                "task.hprs:3:17: this '(' is never closed.\n"
                "    3 | ensure safe: abs(x <= 1\n"
                "      |                 ^"
            ),
        ),
        Malformed(
            "An unclosed parenthesis at the end of the text",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: abs(x <= 1"),
            (
                "task.hprs:3:17: this '(' is never closed.\n"
                "    3 | ensure safe: abs(x <= 1\n"
                "      |                 ^"
            ),
        ),
        Malformed(
            "A parenthesis that closes nothing",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: abs(x)) <= 1"),
            (
                "task.hprs:3:20: this ')' closes nothing.\n"
                "    3 | ensure safe: abs(x)) <= 1\n"
                "      |                    ^"
            ),
        ),
        Malformed(
            "Brackets that do not match",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: abs(x] <= 1"),
            (
                "task.hprs:3:19: this ']' closes the '(' of line 3, column 17, which needs a ')'.\n"
                "    3 | ensure safe: abs(x] <= 1\n"
                "      |                   ^"
            ),
        ),
        Malformed(
            "A typographic relation",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x ≤ 1"),
            (
                "task.hprs:3:16: '≤' is written <=.\n"
                "    3 | ensure safe: x ≤ 1\n"
                "      |                ^"
            ),
        ),
        Malformed(
            "A degree sign",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x <= 12°"),
            (
                "task.hprs:3:21: '°' is written deg, as in 12 deg.\n"
                "    3 | ensure safe: x <= 12°\n"
                "      |                     ^"
            ),
        ),
        Malformed(
            "A dash for the minus sign",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x >= –1"),
            (
                "task.hprs:3:19: '–' is not the minus sign '-'. It is not the plain sign it looks like; type it again.\n"
                "    3 | ensure safe: x >= –1\n"
                "      |                   ^"
            ),
        ),
        Malformed(
            "A Greek name",
            "signal θ in [0, 1]",
            (
                "task.hprs:1:8: 'θ' cannot be part of a name: names use a to z, A to Z, digits and '_'.\n"
                "    1 | signal θ in [0, 1]\n"
                "      |        ^"
            ),
        ),
        Malformed(
            "A no-break space",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x\xa0<= 1"),
            (
                "task.hprs:3:15: the invisible character U+00A0 has no meaning here; delete it.\n"
                "    3 | ensure safe: x <= 1\n"
                "      |               ^"
            ),
        ),
        Malformed(
            "A NUL character",
            "signal x\x00 in [0, 1]",
            (
                "task.hprs:1:9: this is a NUL character; the file is damaged or not a text.\n"
                "    1 | signal x  in [0, 1]\n"
                "      |         ^"
            ),
        ),
    ),
    "Numbers": (
        Malformed(
            "A number beyond the largest float",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x <= 1e999"),
            (
                "task.hprs:3:19: this number is too large; the largest is about 1.8e308.\n"
                "    3 | ensure safe: x <= 1e999\n"
                "      |                   ^^^^^"
            ),
        ),
        Malformed(
            "A number below the smallest float",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x <= 1e-999"),
            (
                "task.hprs:3:19: this number is too small to tell from 0; the smallest is about 4.9e-324.\n"
                "    3 | ensure safe: x <= 1e-999\n"
                "      |                   ^^^^^^"
            ),
        ),
        Malformed(
            "A result beyond the largest float",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x <= 10 ** 400"),
            (
                "task.hprs:3:19: the result is too large for a float. Bound it with max(), clip() or `let`.\n"
                "    3 | ensure safe: x <= 10 ** 400\n"
                "      |                   ^^^^^^^^^"
            ),
        ),
        Malformed(
            "A number with separators",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x <= 1_000"),
            (
                "task.hprs:3:20: a number has no separators: write 1000.\n"
                "    3 | ensure safe: x <= 1_000\n"
                "      |                    ^^^^"
            ),
        ),
        Malformed(
            "Infinity in a condition",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x <= inf"),
            (
                "task.hprs:3:19: inf may stand only at the end of a range.\n"
                "    3 | ensure safe: x <= inf\n"
                "      |                   ^^^"
            ),
        ),
    ),
    "Signals": (
        Malformed(
            "A signal without a range",
            'signal x = obs[0] "m"',
            (
                "task.hprs:1:19: signal 'x' needs a range here: in [LOW, HIGH].\n"
                '    1 | signal x = obs[0] "m"\n'
                "      |                   ^^^"
            ),
        ),
        Malformed(
            "A signal without anything",
            "signal x",
            (
                "task.hprs:1:9: signal 'x' needs a range here: in [LOW, HIGH].\n"
                "    1 | signal x\n"
                "      |         ^"
            ),
        ),
        Malformed(
            "A signal without a name",
            "signal = obs[0] in [0, 1]",
            (
                "task.hprs:1:8: 'signal' needs a name, found '='.\n"
                "    1 | signal = obs[0] in [0, 1]\n"
                "      |        ^"
            ),
        ),
        Malformed(
            "An initial value and no range",
            "signal x = info.progress initially 0",
            (
                "task.hprs:1:37: signal 'x' needs a range here: in [LOW, HIGH].\n"
                "    1 | signal x = info.progress initially 0\n"
                "      |                                     ^"
            ),
        ),
        Malformed(
            "A range in parentheses",
            "signal x in (0, 1)",
            (
                "task.hprs:1:13: a range is written in [LOW, HIGH], with brackets.\n"
                "    1 | signal x in (0, 1)\n"
                "      |             ^"
            ),
        ),
        Malformed(
            "A range with one end",
            "signal x in [1]",
            (
                "task.hprs:1:15: a range is written in [LOW, HIGH], two ends with a comma between them.\n"
                "    1 | signal x in [1]\n"
                "      |               ^"
            ),
        ),
        Malformed(
            "A range with three ends",
            "signal x in [0, 1, 2]",
            (
                "task.hprs:1:18: a range is written in [LOW, HIGH], with two ends.\n"
                "    1 | signal x in [0, 1, 2]\n"
                "      |                  ^"
            ),
        ),
        Malformed(
            "An unfinished end of a range",
            "signal x in [0, 1 +]",
            (
                "task.hprs:1:20: a value is missing after '+', found ']'.\n"
                "    1 | signal x in [0, 1 +]\n"
                "      |                    ^"
            ),
        ),
        Malformed(
            "A range with a colon",
            "signal x in [0:1]",
            (
                "task.hprs:1:15: a range is written in [LOW, HIGH], two ends with a comma between them.\n"
                "    1 | signal x in [0:1]\n"
                "      |               ^"
            ),
        ),
        Malformed(
            "A range upside down",
            "signal x in [5, -5]",
            (
                "task.hprs:1:8: signal 'x' needs low < high, got [5, -5].\n"
                "    1 | signal x in [5, -5]\n"
                "      |        ^"
            ),
        ),
        Malformed(
            "A range that depends on a signal",
            ("signal x in [0, 1]\nsignal y in [0, x]"),
            (
                "task.hprs:2:17: the range of signal 'y' must be a constant expression, but it depends on a signal.\n"
                "    2 | signal y in [0, x]\n"
                "      |                 ^"
            ),
        ),
        Malformed(
            "The range before the source",
            "signal x in [0, 1] = obs[0]",
            (
                "task.hprs:1:20: '=' is out of place. A signal is written signal NAME[length] = SOURCE initially VALUE in [LOW, HIGH] \"unit\".\n"
                "    1 | signal x in [0, 1] = obs[0]\n"
                "      |                    ^"
            ),
        ),
        Malformed(
            "The unit before the range",
            'signal x "m" in [0, 1]',
            (
                "task.hprs:1:10: signal 'x' needs a range here: in [LOW, HIGH].\n"
                '    1 | signal x "m" in [0, 1]\n'
                "      |          ^^^"
            ),
        ),
        Malformed(
            "A unit in single quotes",
            "signal x in [0, 1] 'm'",
            (
                'task.hprs:1:20: a unit stands in double quotes, as in "m/s".\n'
                "    1 | signal x in [0, 1] 'm'\n"
                "      |                    ^"
            ),
        ),
        Malformed(
            "A unit without its closing quote",
            'signal x in [0, 1] "m',
            (
                "task.hprs:1:20: the quotes of this unit are never closed on its line.\n"
                '    1 | signal x in [0, 1] "m\n'
                "      |                    ^"
            ),
        ),
        Malformed(
            "A length that is not a whole number",
            "signal x[n] in [0, 1]",
            (
                "task.hprs:1:10: the length of 'x' is a whole number, as in signal x[3].\n"
                "    1 | signal x[n] in [0, 1]\n"
                "      |          ^"
            ),
        ),
        Malformed(
            "A length of 0",
            "signal x[0] in [0, 1]",
            (
                "task.hprs:1:8: signal 'x' needs a length from 1 to 1000000, got 0.\n"
                "    1 | signal x[0] in [0, 1]\n"
                "      |        ^"
            ),
        ),
        Malformed(
            "A source that is not one",
            "signal x = state[0] in [0, 1]",
            (
                "task.hprs:1:12: a source reads obs, action, last_action, info, not 'state'.\n"
                "    1 | signal x = state[0] in [0, 1]\n"
                "      |            ^^^^^"
            ),
        ),
        Malformed(
            "A source that computes",
            "signal x = 2 * obs[0] in [0, 1]",
            (
                "task.hprs:1:12: the source of signal 'x' reads obs, action, last_action, info, as in obs[0].\n"
                "    1 | signal x = 2 * obs[0] in [0, 1]\n"
                "      |            ^"
            ),
        ),
        Malformed(
            "Arithmetic after a source",
            "signal x = obs[0] * 2 in [0, 1]",
            (
                "task.hprs:1:19: a source only reads. Compute with `let`, as in let NAME = 2 * x.\n"
                "    1 | signal x = obs[0] * 2 in [0, 1]\n"
                "      |                   ^"
            ),
        ),
        Malformed(
            "An index of two numbers",
            "signal x = obs[0, 1] in [0, 1]",
            (
                "task.hprs:1:17: a source has one index: a whole number or a slice such as 0:3, for the last axis.\n"
                "    1 | signal x = obs[0, 1] in [0, 1]\n"
                "      |                 ^"
            ),
        ),
        Malformed(
            "An index of text",
            'signal x = obs["speed"] in [0, 1]',
            (
                "task.hprs:1:16: a source has one index: a whole number or a slice such as 0:3, for the last axis.\n"
                '    1 | signal x = obs["speed"] in [0, 1]\n'
                "      |                ^^^^^^^"
            ),
        ),
        Malformed(
            "An index of a fraction",
            "signal x = obs[1.5] in [0, 1]",
            (
                "task.hprs:1:16: '1.5' is not a whole number below 10 ** 9.\n"
                "    1 | signal x = obs[1.5] in [0, 1]\n"
                "      |                ^^^"
            ),
        ),
        Malformed(
            "A number for a key",
            "signal x = obs.0 in [0, 1]",
            (
                "task.hprs:1:15: an entry of a dictionary is written obs.key; read a component as obs[0].\n"
                "    1 | signal x = obs.0 in [0, 1]\n"
                "      |               ^^"
            ),
        ),
        Malformed(
            "A word too many",
            "signal x = obs[0] metres in [0, 1]",
            (
                "task.hprs:1:19: 'metres' is out of place. A signal is written signal NAME[length] = SOURCE initially VALUE in [LOW, HIGH] \"unit\".\n"
                "    1 | signal x = obs[0] metres in [0, 1]\n"
                "      |                   ^^^^^^"
            ),
        ),
        Malformed(
            "A key after an index",
            "signal x = obs[0].speed in [0, 1]",
            (
                "task.hprs:1:18: a source is a path of keys and then one index for the last axis: obs.pose[0].\n"
                "    1 | signal x = obs[0].speed in [0, 1]\n"
                "      |                  ^"
            ),
        ),
        Malformed(
            "info without a key",
            "signal x = info[0] in [0, 1]",
            (
                "task.hprs:1:12: info is a dictionary: name its entry, as in info.progress.\n"
                "    1 | signal x = info[0] in [0, 1]\n"
                "      |            ^^^^"
            ),
        ),
        Malformed(
            "action with a key",
            "signal x = action.steering in [0, 1]",
            (
                "task.hprs:1:12: action has no entries: read it as action[0].\n"
                "    1 | signal x = action.steering in [0, 1]\n"
                "      |            ^^^^^^"
            ),
        ),
        Malformed(
            "A slice without a length",
            "signal x = obs[0:3] in [0, 1]",
            (
                "task.hprs:1:8: signal 'x' reads a slice: give it a length, as in signal x[3].\n"
                "    1 | signal x = obs[0:3] in [0, 1]\n"
                "      |        ^"
            ),
        ),
        Malformed(
            "A length without a slice",
            "signal x[3] = obs[0] in [0, 1]",
            (
                "task.hprs:1:8: signal 'x' has length 3 and reads one component; use a slice.\n"
                "    1 | signal x[3] = obs[0] in [0, 1]\n"
                "      |        ^"
            ),
        ),
        Malformed(
            "An initial value outside the range",
            "signal x = info.progress initially 2 in [0, 1]",
            (
                "task.hprs:1:8: signal 'x' starts at 2, outside its range [0, 1].\n"
                "    1 | signal x = info.progress initially 2 in [0, 1]\n"
                "      |        ^"
            ),
        ),
        Malformed(
            "A signal declared twice",
            ("signal x in [0, 1]\nsignal x in [0, 2]"),
            (
                "task.hprs:2:8: 'x' is declared twice; signals, constants, definitions and requirements share one namespace.\n"
                "    2 | signal x in [0, 2]\n"
                "      |        ^"
            ),
        ),
        Malformed(
            "A constant of the language as name",
            "const deg = 0.01745",
            (
                "task.hprs:1:7: 'deg' is a reserved word; choose another name.\n"
                "    1 | const deg = 0.01745\n"
                "      |       ^^^"
            ),
        ),
        Malformed(
            "A reserved name",
            "signal max in [0, 1]",
            (
                "task.hprs:1:8: 'max' is a reserved word; choose another name.\n"
                "    1 | signal max in [0, 1]\n"
                "      |        ^^^"
            ),
        ),
        Malformed(
            "The environment's reward as a signal",
            "signal env_reward in [0, 1]",
            (
                "task.hprs:1:8: 'env_reward' is reserved for the environment's own reward.\n"
                "    1 | signal env_reward in [0, 1]\n"
                "      |        ^^^^^^^^^^"
            ),
        ),
    ),
    "Constants and definitions": (
        Malformed(
            "No equals sign",
            "const mark 1",
            (
                "task.hprs:1:12: 'mark' needs '=' and a value: const mark = EXPRESSION.\n"
                "    1 | const mark 1\n"
                "      |            ^"
            ),
        ),
        Malformed(
            "A colon for the equals sign",
            "const mark: 1",
            (
                "task.hprs:1:11: 'const' declares with '=': const mark = EXPRESSION.\n"
                "    1 | const mark: 1\n"
                "      |           ^"
            ),
        ),
        Malformed(
            "Pascal's assignment",
            "const mark := 1",
            (
                "task.hprs:1:12: ':=' is not needed: a declaration uses '=', a requirement ':'.\n"
                "    1 | const mark := 1\n"
                "      |            ^^"
            ),
        ),
        Malformed(
            "No value",
            "const mark =",
            (
                "task.hprs:1:13: a value is missing after '=', found the end of the line.\n"
                "    1 | const mark =\n"
                "      |             ^"
            ),
        ),
        Malformed(
            "Chained assignment",
            "const a = b = 1",
            (
                "task.hprs:1:13: a declaration has one '='. Declare each name on a line of its own.\n"
                "    1 | const a = b = 1\n"
                "      |             ^"
            ),
        ),
        Malformed(
            "A constant with a range",
            "const mark = 1 in [0, 2]",
            (
                "task.hprs:1:16: a constant has no range; only signals and `let` have one.\n"
                "    1 | const mark = 1 in [0, 2]\n"
                "      |                ^^"
            ),
        ),
        Malformed(
            "A constant that depends on a signal",
            ("const mark = x\nsignal x in [-5, 5]\nsignal y in [0, 1]\n"),
            (
                "task.hprs:1:14: 'x' is used before its declaration. Order the task: constants, signals, definitions, requirements.\n"
                "    1 | const mark = x\n"
                "      |              ^"
            ),
        ),
        Malformed(
            "A definition with a unit",
            ('signal x in [-5, 5]\nsignal y in [0, 1]\nlet d = abs(x) "m"'),
            (
                "task.hprs:3:16: only signals have units.\n"
                '    3 | let d = abs(x) "m"\n'
                "      |                ^^^"
            ),
        ),
        Malformed(
            "A definition with a length",
            "let v[3] = 1",
            (
                "task.hprs:1:6: only signals state a length; 'v' takes its own from its expression.\n"
                "    1 | let v[3] = 1\n"
                "      |      ^"
            ),
        ),
        Malformed(
            "A range that contradicts the expression",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nlet d = abs(x) in [-2, -1]"),
            (
                "task.hprs:3:5: the range of 'd' [-2, -1] does not meet what its expression can be: [0, 5].\n"
                "    3 | let d = abs(x) in [-2, -1]\n"
                "      |     ^"
            ),
        ),
        Malformed(
            "A name used before its declaration",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nlet a = b\nlet b = x"),
            (
                "task.hprs:3:9: 'b' is used before its declaration. Order the task: constants, signals, definitions, requirements.\n"
                "    3 | let a = b\n"
                "      |         ^"
            ),
        ),
    ),
    "Meaning": (
        Malformed(
            "A misspelt name",
            ("signal theta in [-1, 1]\nensure safe: thetta <= 0.5"),
            (
                "task.hprs:2:14: unknown name 'thetta'. Did you mean 'theta'?\n"
                "    2 | ensure safe: thetta <= 0.5\n"
                "      |              ^^^^^^"
            ),
        ),
        Malformed(
            "An overflow in the range",
            ("signal x in [-1e3, 1e3]\nensure safe: cos(exp(x)) <= 0.5"),
            (
                "task.hprs:2:18: the result is too large for a float. Bound it with max(), clip() or `let`.\n"
                "    2 | ensure safe: cos(exp(x)) <= 0.5\n"
                "      |                  ^^^^^^"
            ),
        ),
        Malformed(
            "Division by a range with 0",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: 1 / x <= 1"),
            (
                "task.hprs:3:14: the divisor's range [-5, 5] contains 0. Bound it with max(), clip() or `let`.\n"
                "    3 | ensure safe: 1 / x <= 1\n"
                "      |              ^^^^^"
            ),
        ),
        Malformed(
            "The logarithm of a range with 0",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: log(y) <= 1"),
            (
                "task.hprs:3:14: log needs a positive range, got [0, 1]. Bound it with max(), clip() or `let`.\n"
                "    3 | ensure safe: log(y) <= 1\n"
                "      |              ^^^^^^"
            ),
        ),
        Malformed(
            "The root of a negative range",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: sqrt(x) <= 1"),
            (
                "task.hprs:3:14: sqrt needs a range that is not negative, got [-5, 5]. Bound it with max(), clip() or `let`.\n"
                "    3 | ensure safe: sqrt(x) <= 1\n"
                "      |              ^^^^^^^"
            ),
        ),
        Malformed(
            "A broken power",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x ** 0.5 <= 1"),
            (
                "task.hprs:3:14: the base's range [-5, 5] must be not negative under this exponent. Bound it with max(), clip() or `let`.\n"
                "    3 | ensure safe: x ** 0.5 <= 1\n"
                "      |              ^^^^^^^^"
            ),
        ),
        Malformed(
            "Vectors of two lengths",
            ("signal a[2] in [0, 1]\nsignal b[3] in [0, 1]\nensure safe: max(a + b) <= 1"),
            (
                "task.hprs:3:18: vectors of lengths 2 and 3 do not match.\n"
                "    3 | ensure safe: max(a + b) <= 1\n"
                "      |                  ^^^^^"
            ),
        ),
        Malformed(
            "A vector in a condition",
            ("signal beam[5] in [0, 10]\nensure safe: beam >= 1"),
            (
                "task.hprs:2:14: requirement 'safe' compares a vector of 5; reduce it with min, max, sum, mean or norm.\n"
                "    2 | ensure safe: beam >= 1\n"
                "      |              ^^^^^^^^^"
            ),
        ),
        Malformed(
            "A vector mixed with a scalar in max",
            ("signal beam[5] in [0, 10]\nensure safe: max(beam, 1) >= 1"),
            (
                "task.hprs:2:14: max() reduces one vector or compares several scalars, not a mix of them.\n"
                "    2 | ensure safe: max(beam, 1) >= 1\n"
                "      |              ^^^^^^^^^^^^"
            ),
        ),
        Malformed(
            "A condition that cannot hold",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: abs(x) >= 7"),
            (
                "task.hprs:3:8: requirement 'safe' can never be satisfied: its margin lies in [-7, -2]. The threshold 7 is outside the range [0, 5].\n"
                "    3 | ensure safe: abs(x) >= 7\n"
                "      |        ^^^^"
            ),
        ),
        Malformed(
            "A strict condition that cannot hold",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure safe: x > 5"),
            (
                "task.hprs:3:8: requirement 'safe' can never be satisfied: its margin lies in [-10, 0].\n"
                "    3 | ensure safe: x > 5\n"
                "      |        ^^^^"
            ),
        ),
        Malformed(
            "A comfort requirement without a bound",
            ("signal v in [0, inf]\nencourage calm: v <= 1"),
            (
                "task.hprs:2:17: requirement 'calm' needs a finite lower bound for its continuous score, but its margin has none. Give its signals finite ranges, use clip(), or name the expression with `let NAME = ... in [LOW, HIGH]`.\n"
                "    2 | encourage calm: v <= 1\n"
                "      |                 ^^^^^^"
            ),
        ),
    ),
    "Preferences": (
        Malformed(
            "A preference as a comparison",
            (
                "signal x in [-5, 5]\n"
                "signal y in [0, 1]\n"
                "ensure a: x <= 1\n"
                "ensure b: y <= 0.5\n"
                "prefer a > b"
            ),
            (
                "task.hprs:5:10: a preference is written prefer HIGHER over LOWER, with two labels.\n"
                "    5 | prefer a > b\n"
                "      |          ^"
            ),
        ),
        Malformed(
            "A preference of three",
            (
                "signal x in [-5, 5]\n"
                "signal y in [0, 1]\n"
                "ensure a: x <= 1\n"
                "ensure b: y <= 0.5\n"
                "ensure c: y <= 0.6\n"
                "prefer a over b over c"
            ),
            (
                "task.hprs:6:17: a preference ranks two requirements: prefer HIGHER over LOWER. Add a line per pair.\n"
                "    6 | prefer a over b over c\n"
                "      |                 ^^^^"
            ),
        ),
        Malformed(
            "A preference for a keyword",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure a: x <= 1\nprefer safety over in"),
            (
                "task.hprs:4:20: 'in' is a reserved word and not the label of a requirement.\n"
                "    4 | prefer safety over in\n"
                "      |                    ^^"
            ),
        ),
        Malformed(
            "A preference with one label",
            ("signal x in [-5, 5]\nsignal y in [0, 1]\nensure a: x <= 1\nprefer a"),
            (
                "task.hprs:4:9: a preference is written prefer HIGHER over LOWER, with two labels.\n"
                "    4 | prefer a\n"
                "      |         ^"
            ),
        ),
        Malformed(
            "A preference for an unknown label",
            (
                "signal x in [-5, 5]\n"
                "signal y in [0, 1]\n"
                "ensure near: x <= 1\n"
                "ensure slow: y <= 0.5\n"
                "prefer near over slov"
            ),
            (
                "task.hprs:5:1: 'prefer' names the unknown requirement 'slov'. Did you mean 'slow'?\n"
                "    5 | prefer near over slov\n"
                "      | ^^^^^^^^^^^^^^^^^^^^^"
            ),
        ),
        Malformed(
            "A preference against the classes",
            (
                "signal x in [-5, 5]\n"
                "signal y in [0, 1]\n"
                "ensure a: x <= 1\n"
                "encourage b: y <= 0.5\n"
                "prefer b over a"
            ),
            (
                "task.hprs:5:1: 'prefer b over a' is against the classes: safety comes before target before comfort, always.\n"
                "    5 | prefer b over a\n"
                "      | ^^^^^^^^^^^^^^^"
            ),
        ),
        Malformed(
            "A cycle",
            (
                "signal x in [-5, 5]\n"
                "signal y in [0, 1]\n"
                "ensure a: x <= 1\n"
                "ensure b: y <= 0.5\n"
                "prefer a over b\n"
                "prefer b over a"
            ),
            (
                "task.hprs:6:1: 'prefer b over a' closes a cycle: 'a' is already at least as important as 'b'.\n"
                "    6 | prefer b over a\n"
                "      | ^^^^^^^^^^^^^^^"
            ),
        ),
    ),
}


def render() -> str:
    """The page docs/errors.md."""
    count = sum(map(len, MALFORMED.values()))
    parts = [_INTRODUCTION.format(count=count)]
    for section, rows in MALFORMED.items():
        parts.append(f"## {section}\n")
        for row in rows:
            text = row.text.replace("\0", "\u2400").rstrip("\n")
            parts.append(f"### {row.title}\n")
            parts.append(f"```text\n{text}\n```\n")
            parts.append(f"```text\n{row.message}\n```\n")
    return "\n".join(parts)


_INTRODUCTION = """# Error messages of the task language

Every mistake in a task is reported with file, line, column, the line itself and a caret below the
place. This page shows {count} malformed tasks (`task.hprs`) and what is said about each. It is
written by `python tests/spec/malformed.py > docs/errors.md` from the table that is also the test.

In Python all of them are `hprs.SpecError`: `SpecSyntaxError` where the text does not follow the
grammar, `SpecValidationError` where it does and its meaning cannot be meant.
"""

if __name__ == "__main__":
    sys.stdout.write(render())
