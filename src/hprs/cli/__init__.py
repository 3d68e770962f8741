"""The command line: one file a subcommand; each parses, calls and prints."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

DONE, INPUT_WRONG, CALL_WRONG, INTERRUPTED = 0, 1, 2, 130
"""Exit codes."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Args:
        argv: The arguments; None: those of the process.

    Returns:
        The exit code: 0 done, 1 the input is wrong, 2 the call is wrong, 130 interrupted.
    """
    from hprs.cli.commands import parse
    from hprs.errors import HprsError

    try:
        return parse(sys.argv[1:] if argv is None else list(argv)).run()
    except SystemExit as exit_:
        return exit_.code if isinstance(exit_.code, int) else CALL_WRONG
    except HprsError as error:
        return _complain(error)
    except KeyboardInterrupt:
        print("hprs: interrupted.", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # Whoever read the output, such as `head`, has seen enough; nothing may be flushed to it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE


def _complain(error: Exception) -> int:
    from hprs.errors import RunError, SpecError, UsageError

    message = str(error)
    if not isinstance(error, SpecError):
        message = "hprs: " + " ".join(message.split())
    print(message, file=sys.stderr)
    return CALL_WRONG if isinstance(error, UsageError | RunError) else INPUT_WRONG
