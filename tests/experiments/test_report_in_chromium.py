"""The report's page in a browser without a network: it draws, sorts, and fits a phone."""

from hprs.experiments.report import Picture, Section, write_report
from tests.experiments.test_report import EPISODES, FLOORS, recorded, section
from tests.explanation.chromium import chromium

DOT = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000001000000010806000000"
    "1f15c4890000000d49444154789c6360606060000000050001a5f645400000000049454e44ae426082"
)


def made(tmp_path):
    recorded(tmp_path / "runs", seeds=4)
    recorded(tmp_path / "runs", "sparse", seeds=4, good=lambda seed: seed == 0)
    found = section(tmp_path / "runs")
    pictures = (Picture("a storyboard", "png", DOT, moves=False),)
    shown = Section(found.benchmark, found.found, FLOORS, EPISODES, pictures)
    return write_report([shown], tmp_path / "report", title="Title </script>", warnings=["One."])


def test_the_page_draws_sorts_and_fits_a_phone(tmp_path):
    page = made(tmp_path)
    with chromium(tmp_path / "profile") as browser:
        browser.open(page.as_uri())
        assert browser.text("h1") == "Title </script>"
        assert browser.text(".warnings li") == "One."
        assert browser.evaluate("document.querySelectorAll('.chart polyline').length") == 2
        # The upper right point of the first line is at an S+T of 1.
        points = browser.evaluate(
            "document.querySelector('.chart polyline').getAttribute('points')"
        )
        ys = [float(point.split(",")[1]) for point in points.split()]
        assert ys[0] > ys[-1] == min(ys)

        browser.evaluate("document.querySelector('.legend button').click()")
        assert browser.evaluate("document.querySelectorAll('.chart polyline').length") == 1

        # S+T+C, first descending, then ascending.
        head = "[...document.querySelectorAll('section th button')].find(b => b.textContent === 'S+T+C')"
        first = "document.querySelector('section tbody td').textContent"
        browser.evaluate(f"{head}.click()")
        assert browser.evaluate(first) == "hprs paper"
        browser.evaluate(f"{head}.click()")
        assert browser.evaluate(first) == "doing nothing"

        browser.send(
            "Emulation.setDeviceMetricsOverride",
            width=360, height=740, deviceScaleFactor=2, mobile=True,
        )  # fmt: skip
        browser.open(page.as_uri())
        assert browser.evaluate("document.documentElement.scrollWidth") <= 360
        # The name of a row can be read: it is no column of single letters.
        assert browser.evaluate("document.querySelector('tbody td').clientHeight") < 60
        requests = [e for e in browser.events if e["method"] == "Network.requestWillBeSent"]
        addresses = {e["params"]["request"]["url"].partition(":")[0] for e in requests}
        assert addresses <= {"file", "data"}
        failures = [
            e
            for e in browser.events
            if e["method"] in ("Runtime.exceptionThrown", "Log.entryAdded")
        ]
        assert not failures
