"""Explains an episode: which requirement earned or cost what, step by step."""
