"""The command line of the runtime, where hprs is not installed."""

from __future__ import annotations

import argparse
import sys
from typing import List, Optional, Sequence

from hprs.deploy.archive import load_bundle
from hprs.deploy.bundle import Bundle
from hprs.errors import HprsError


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """Check a bundle and say what it is.

    Returns:
        The exit code: 0 done, 1 the bundle is wrong, 2 the call is wrong.
    """
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("bundle", metavar="BUNDLE", help="a policy bundle")
    given = parser.parse_args(arguments)
    try:
        bundle = load_bundle(given.bundle)
        bundle.self_check()
    except HprsError as error:
        sys.stderr.write("{}\n".format(error))
        return 1
    sys.stdout.write("\n".join(description(bundle)) + "\n")
    return 0


def description(bundle: Bundle) -> List[str]:
    """What a bundle is, line by line."""
    found = bundle.provenance
    requirements = [one["label"] for one in bundle.task.get("requirements", [])]
    return [
        "environment    {}".format(found.get("environment", "not said")),
        "trained by     {}, step {}".format(
            found.get("written_by", "not said"), found.get("step", "not said")
        ),
        "observation    shape {}".format(bundle.observation.shape),
        "action         shape {}".format(bundle.action.shape),
        "rate           {}".format("not said" if not bundle.rate else "%g Hz" % bundle.rate),
        "requirements   {}".format(", ".join(requirements) or "none"),
        "self-check     passed",
    ]
