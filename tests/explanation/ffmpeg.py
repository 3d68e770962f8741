"""The program ffmpeg, where it is installed."""

import os
import shutil

import pytest


def require_ffmpeg():
    """Skip the test that calls this where there is no ffmpeg, or fail where there must be one."""
    if shutil.which("ffmpeg") is None:
        if "ffmpeg" in os.environ.get("HPRS_TEST_NEEDS", "").split():
            pytest.fail("ffmpeg is needed, and not installed")
        pytest.skip("needs the program ffmpeg")
