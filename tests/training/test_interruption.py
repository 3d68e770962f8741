import signal
import threading

import pytest

from hprs.training.interruption import Interruption


@pytest.fixture(autouse=True)
def interrupts():
    """A shell that starts a job in the background lets it ignore SIGINT; these tests need it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_the_first_signal_is_a_request_and_the_second_acts():
    heard = []
    with pytest.raises(KeyboardInterrupt), Interruption(lambda: heard.append(1)) as interruption:
        signal.raise_signal(signal.SIGINT)
        assert interruption.requested
        assert heard == [1]
        signal.raise_signal(signal.SIGINT)


def test_handlers_are_given_back():
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    with Interruption(lambda: None):
        assert signal.getsignal(signal.SIGINT) != before[0]
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


def test_another_thread_may_enter_it():
    requested = []

    def work():
        with Interruption(lambda: None) as interruption:
            requested.append(interruption.requested)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert requested == [False]
