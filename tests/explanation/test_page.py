"""The page of an explanation, as text: it is self-contained, and user's text is never markup."""

import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from hprs.explanation.explanation import explain
from hprs.explanation.film import Film
from hprs.explanation.page import page
from hprs.training.page_data import embedded
from tests.explanation.episodes import TASK, short_film, trace

HOSTILE = "</title><script>alert(1)</script>{{data}}<!-- & \u2028"


def written(steps=30, film=None, **options):
    found = explain(TASK, trace(steps), **{"title": "An episode", "rate": 50.0, **options})
    return found, page(found, film or Film(trouble="a trace has none."))


def data_of(text):
    return json.loads(re.search(r'id="data">(.*?)</script>', text, re.DOTALL)[1])


class Elements(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.tags = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))


def test_the_data_are_the_episodes():
    found, text = written(film=short_film(30))
    data = data_of(text)
    assert data["stops"] == list(range(31))
    assert data["potential"] == pytest.approx(found.potential.tolist(), rel=1e-8)
    for shown, part in zip(data["parts"], found.parts, strict=True):
        assert shown["contributions"] == pytest.approx(part.contributions.tolist(), rel=1e-8)
        assert shown["margins"] == pytest.approx(part.margins.tolist(), rel=1e-8)
        assert shown["holds"] == part.satisfied.tolist()
    assert [step for step, _ in data["frames"]] == list(range(31))
    assert data["violations"]["safety"] == {"label": "clear", "step": 30}
    assert data["notes"] == ["Signal 'lap' left its range in 5 of 31 states."]


def test_text_of_users_is_never_markup():
    _, plain = written()
    _, text = written(title=HOSTILE)
    assert [tag for tag, _ in Elements(text).tags] == [tag for tag, _ in Elements(plain).tags]
    assert "alert(1)" not in text.replace("\\u003cscript\\u003ealert(1)", "").replace(
        "&lt;script&gt;alert(1)", ""
    ).replace("onerror=alert(1)\\u003e", "")
    assert data_of(text)["title"] == HOSTILE
    assert "</script><img" in data_of(text)["task"]


def test_embedded_data_cannot_end_their_element():
    text = embedded({"</script>": "<!--<script>&amp;"})
    assert not set("<>&") & set(text)
    assert json.loads(text) == {"</script>": "<!--<script>&amp;"}


def test_nothing_is_loaded_from_elsewhere():
    _, text = written(film=short_film(30))
    for _, attributes in Elements(text).tags:
        assert not {"src", "href", "data", "action"} & {k for k, v in attributes.items() if v}
    # A namespace is a name, not an address.
    assert re.findall(r"https?://[^\"' ]*", text) == ["http://www.w3.org/2000/svg"]
    assert "@import" not in text
    assert "url(" not in text.replace("url(#", "")
    assert "default-src 'none'" in text


def test_a_long_episode_says_how_it_is_drawn():
    found, text = written(steps=100_000)
    data = data_of(text)
    assert len(text) < 1_500_000
    assert "every 167 states" in data["notes"][0]
    assert data["notes"][1] == "No pictures: a trace has none."
    assert data["stops"][-1] == 100_000
    assert min(data["parts"][0]["least"]) == found.parts[0].worst == -0.5


def test_pictures_that_were_left_out_are_told():
    _, text = written(film=Film(every=2, frames=short_film(4).frames))
    assert "There is a picture of every 2nd step, to keep the page small." in data_of(text)["notes"]


def test_infinite_margins_and_bounds_can_be_written():
    from hprs import parse_task

    task = parse_task("signal x in [-inf, inf]\nensure low: x <= 1")
    found = explain(task, {"x": np.array([0.0, -np.inf, np.inf])})
    part = data_of(page(found, Film()))["parts"][0]
    assert part["margins"] == [1.0, 1e308, -1e308]
    assert (part["low"], part["high"]) == (None, None)
