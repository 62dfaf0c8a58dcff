"""A child forked while threads detect and describe works: no lock of ours is waited for in it."""

import os

import pytest
from tests.reliability.child import run

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")

FORKING = """
threads, forks = {threads}, {forks}
limo_hog.set_num_threads(threads)
hog, image = armed(), people(96, 160)
crops = np.stack([image[:128, :64]] * 12)
network = limo_hog.models.load_model("limo").second_look.compiled()
windows = np.array([[x, 3, 32, 64] for x in range(40)], float)

def answers():
    looked = network.answers(image, windows)
    return *hog.detectMultiScale(image, -0.5, scale=1.2), limo_hog.describe(crops), looked

wanted = answers()
stop = threading.Event()

def busy():
    while not stop.is_set():
        answers()

for _ in range(4):
    threading.Thread(target=busy, daemon=True).start()
for number in range(forks):
    child = os.fork()
    if child == 0:
        code = 1
        try:
            found = answers()
            code = 0 if all(np.array_equal(a, b) for a, b in zip(found, wanted)) else 2
        finally:
            os._exit(code)
    deadline = time.monotonic() + 60
    while (done := os.waitpid(child, os.WNOHANG)) == (0, 0):
        if time.monotonic() > deadline:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            print("child", number, "hangs")
            os._exit(3)
        time.sleep(0.0005)
    if done[1] != 0:
        print("child", number, "ended with status", done[1])
        os._exit(4)
stop.set()
print("all", forks, "children answered")
os._exit(0)
"""


MANY = pytest.param(5000, 3500, marks=[pytest.mark.slow, pytest.mark.timeout(3600)])


@pytest.mark.parametrize(("forks", "timeout"), [(200, 280), MANY])
@pytest.mark.parametrize("threads", [0, 1])
def test_children_forked_while_threads_detect_and_describe_answer(threads: int, forks: int, timeout: float) -> None:
    done = run(FORKING.format(threads=threads, forks=forks), timeout)
    assert done.stdout.splitlines()[-1:] == [f"all {forks} children answered"], done.stdout + done.stderr
