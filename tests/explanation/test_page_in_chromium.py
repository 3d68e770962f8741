"""The page of an explanation in a browser without network."""

import pytest

from hprs.explanation.explanation import explain
from hprs.explanation.film import Film
from hprs.explanation.page import page
from tests.explanation.chromium import chromium
from tests.explanation.episodes import TASK, short_film, trace

STEPS = 30


@pytest.fixture(scope="module")
def found():
    return explain(TASK, trace(STEPS), title="Lap </script><b id=hurt>", rate=50.0)


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with chromium(tmp_path_factory.mktemp("chromium")) as running:
        yield running


@pytest.fixture(scope="module")
def address(found, tmp_path_factory):
    file = tmp_path_factory.mktemp("page") / "explanation.html"
    file.write_text(page(found, short_film(STEPS)), encoding="utf-8")
    return file.as_uri()


@pytest.fixture
def opened(browser, address):
    browser.open("about:blank")
    browser.open(address)
    return browser


def read(text):
    return float(text.replace("\u2212", "-").replace(",", ""))


def shown(browser, label):
    """The numbers beside a requirement's plot."""
    texts = browser.evaluate(
        f"[...document.querySelectorAll('[data-label={label}] output')].map(o => o.textContent)"
    )
    return texts[0], [read(text) for text in texts[1:]]


def numbers(part, step):
    """The same of the episode."""
    rows = (part.margins, part.scores, part.contributions, part.changes)
    return pytest.approx([float(row[step]) for row in rows], abs=6e-4)


def place(browser):
    """Step of the clock, of the frame, and the cursors' distances from the left."""
    step = int(browser.text("#clock").split("/")[0])
    frame = int(browser.evaluate("document.getElementById('picture').dataset.step"))
    lefts = browser.evaluate("[...document.querySelectorAll('.cursor')].map(c => c.style.left)")
    assert len(set(lefts)) == 1
    return step, frame, float(lefts[0].rstrip("%"))


def test_the_page_loads_without_network_and_without_complaint(opened):
    asked = [
        event["params"]["request"]["url"].partition(":")[0]
        for event in opened.events
        if event["method"] == "Network.requestWillBeSent"
    ]
    assert set(asked) <= {"file", "data"}
    trouble = ("Runtime.exceptionThrown", "Log.entryAdded", "Network.loadingFailed")
    assert [event for event in opened.events if event["method"] in trouble] == []
    assert opened.evaluate(
        "(async () => {const i = document.getElementById('picture');"
        " await i.decode(); return i.naturalWidth})()"
    ) == 60  # fmt: skip


def test_text_of_users_stays_text(opened, found):
    assert opened.text("h1") == found.title
    assert opened.evaluate("document.title") == found.title
    assert opened.evaluate("document.getElementById('hurt')") is None
    assert "onerror=alert(1)" in opened.text("#task")
    assert opened.evaluate("document.querySelectorAll('img').length") == 1


def test_the_header_says_how_the_episode_went(opened, found):
    cards = opened.text("#cards")
    assert f"{found.assessment.pam:.3f}" in cards
    assert "✗ not safe" in cards
    assert "First safety violationstep 30 (0.60 s) clear" in cards


def test_an_address_opens_a_step(browser, address, found):
    browser.open("about:blank")
    browser.open(f"{address}#step=17")
    assert place(browser) == (17, 17, pytest.approx(100 * 17 / STEPS, abs=1e-3))
    for part in found.parts:
        state, values = shown(browser, part.label)
        assert values == numbers(part, 17)
        assert state.startswith("✓") == part.satisfied[17]
    assert read(browser.text("#now-potential")) == pytest.approx(found.potential[17], abs=6e-4)
    assert read(browser.text("#now-shaping")) == pytest.approx(found.shaping[17], abs=6e-4)
    assert browser.text("#now-time") == "0.34 s"


def test_the_slider_moves_frame_cursor_and_numbers(opened, found):
    assert place(opened) == (0, 0, 0.0)
    x, y = opened.evaluate(
        "(() => {const b = document.getElementById('slider').getBoundingClientRect();"
        " return [b.left + b.width * 0.75, b.top + b.height / 2]})()"
    )
    opened.click(x, y)
    step, frame, left = place(opened)
    assert step == frame
    assert 20 <= step <= 25
    assert left == pytest.approx(100 * step / STEPS, abs=1e-3)
    assert shown(opened, "slow")[1] == numbers(found.parts[2], step)


@pytest.mark.parametrize(
    ("key", "shift", "step"),
    [("ArrowRight", False, 18), ("ArrowLeft", False, 16), ("ArrowRight", True, 27),
     ("Home", False, 0), ("End", False, 30)],
)  # fmt: skip
def test_keys_move_the_cursor(browser, address, key, shift, step):
    browser.open("about:blank")
    browser.open(f"{address}#step=17")
    browser.press(key, shift=shift)
    assert place(browser)[:2] == (step, step)


def test_a_click_in_a_plot_moves_the_cursor(opened):
    x, y = opened.evaluate(
        "(() => {const b = document.querySelector('[data-label=clear] .plot')"
        ".getBoundingClientRect(); return [b.left + b.width / 3, b.top + 20]})()"
    )
    opened.click(x, y)
    assert place(opened)[:2] == (10, 10)
    assert opened.text("#tip") == "step 10 (0.20 s)  ·  clear: margin 2.000"


def test_the_first_violation_can_be_jumped_to_and_is_marked(opened):
    opened.evaluate("document.querySelector('[data-label=clear] .jump').click()")
    assert place(opened)[0] == 30
    assert shown(opened, "clear")[0] == "✗ violated"
    assert opened.evaluate("document.querySelectorAll('[data-label=clear] .flag').length") == 1
    assert opened.evaluate(
        "document.querySelector('[data-label=clear]').classList.contains('fails')"
    )


def test_playing_moves_on_and_stops(opened):
    opened.evaluate("document.getElementById('play').click()")
    assert opened.evaluate("document.getElementById('play').ariaLabel") == "Pause"
    opened.evaluate("new Promise(done => setTimeout(done, 700))")
    assert place(opened)[0] > 0
    opened.press(" ")
    assert opened.evaluate("document.getElementById('play').ariaLabel") == "Play"


def test_a_long_episode_without_pictures_opens(browser, tmp_path):
    long = explain(TASK, trace(50_000), title="long")
    file = tmp_path / "long.html"
    file.write_text(page(long, Film(trouble="a trace has none.")), encoding="utf-8")
    browser.open(f"{file.as_uri()}#step=50000")
    assert browser.text("#now-step") == "50,000 of 50,000"
    assert shown(browser, "clear")[1] == numbers(long.parts[0], 50_000)
    assert browser.evaluate("document.getElementById('scene').hidden")
    assert "No pictures: a trace has none." in browser.text("#notes")
