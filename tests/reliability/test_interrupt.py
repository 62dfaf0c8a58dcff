"""Ctrl-C ends every long call within a second."""

import os
from itertools import product

import pytest
from tests.reliability.child import run

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals are sent as POSIX has them")

#: From the signal to the exception [s]; more than asked for, as tests run beside each other.
LATEST = 1.0

INTERRUPTED = """
limo_hog.set_num_threads({threads})
hog = armed()
small = limo_hog.HOGDescriptor((64, 128), (16, 16), (8, 8), (8, 8), 8)
small.setSVMDetector(np.full(small.getDescriptorSize(), 1e-3, np.float32))
sent = []

def interrupt():
    time.sleep(1.5)
    sent.append(time.monotonic())
    os.kill(os.getpid(), signal.SIGINT)

call = lambda: {call}
threading.Thread(target=interrupt, daemon=True).start()
try:
    call()
    print("answered before the signal" if not sent else "the signal was not seen")
except KeyboardInterrupt:
    print("interrupted after", time.monotonic() - sent[0])
sys.stdout.flush()
os._exit(0)
"""


SHARED = [
    "hog.detectMultiScale(people(640, 480), -1e9, (1, 1), useMeanshiftGrouping=True)",
    "hog.detectMultiScale(people(320, 240), -1e9, (4, 4), useMeanshiftGrouping=True)",
    "hog.detectMultiScale(people(640, 480), -1e9, (1, 1))",
    "small.detectMultiScale(people(4000, 3000), 1e9, (2, 2))",
    "small.detect(people(4000, 3000), 1e9, (1, 1))",
    "hog.detectMultiScale(people(8000, 6000, 1), 1e9, scale=1.001)",
    "limo_hog.models.load_model('limo').second_look.compiled().answers(people(64, 64), np.full((40, 4), 2.0**20))",
]
ALONE = [
    "hog.compute(people(1200, 1000), (3, 3))",
    "hog.detect(people(640, 480), 0.0, (8, 8), (0, 0), np.zeros((3_000_000, 2), int))",
    "limo_hog.groupRectangles(np.tile([0, 0, 9, 9], (200_000, 1)), 1)",
]


@pytest.mark.parametrize(("call", "threads"), [*product(SHARED, (1, 2)), *product(ALONE, (1,))])
def test_ctrl_c_ends_a_long_call_within_a_second(call: str, threads: int) -> None:
    done = run(INTERRUPTED.format(call=call, threads=threads), timeout=60)
    words = done.stdout.split()
    assert words[:2] == ["interrupted", "after"], done.stdout + done.stderr
    assert float(words[2]) <= LATEST, done.stdout
