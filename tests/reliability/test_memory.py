"""A size that follows from arguments and cannot be had is a MemoryError that names it, never the end of the process."""

import resource
from pathlib import Path

import pytest
from tests.reliability.child import run

#: `ulimit -v 4000000`.
FOUR_GB = {resource.RLIMIT_AS: 4_000_000 * 1024}

REPORT = """
try:
    {call}
    print("answered")
except Exception as error:
    print(type(error).__name__, "|", isinstance(error, MemoryError), "|", error)
"""

HUGE = "limo_hog.HOGDescriptor((8192, 8192), (8192, 8192), (1, 1), (8192, 8192), 9)"

MODEL = """<?xml version="1.0"?>
<opencv_storage><m type_id="opencv-object-detector-hog">
<winSize>8192 8192</winSize><blockSize>8192 8192</blockSize><blockStride>1 1</blockStride>
<cellSize>8192 8192</cellSize><nbins>9</nbins></m></opencv_storage>
"""


def outcome(call: str, timeout: float = 120, limits: dict[int, int] = FOUR_GB) -> tuple[str, str]:
    """Return the error's class, "memory " before it where it is a MemoryError, and its message."""
    done = run(REPORT.format(call=call), timeout, limits)
    assert done.returncode == 0, f"status {done.returncode}: {done.stdout}{done.stderr}"
    name, memory, message = (done.stdout.strip().splitlines()[-1] + " | | ").split(" | ", 2)
    return ("memory " if memory == "True" else "") + name, message


@pytest.mark.parametrize(
    "call",
    [
        f"{HUGE}.compute(people(64, 64))",
        f"{HUGE}.setSVMDetector(np.zeros(9, np.float32))",
        "armed().computeGradient(people(64, 128), paddingTL=(20000, 20000), paddingBR=(20000, 20000))",
        "fine().detectMultiScale(people(64, 128), padding=(16384, 16384))",
        "armed().compute(people(64, 128), (8, 8), (3000, 3000))",
        "_core.Hog((64, 128), (16, 16), (8, 8), (8, 8), 9, -1.0, 0.2, True, 2**31 - 1, False, _core.default_people_"
        "detector()).detect_multi_scale(people(640, 480), scale=1.0000000000000002, similar=2)",
        "limo_hog.HOGDescriptor((32768, 1000), (1, 1), (1, 1), (1, 1), 64).compute("
        "people(64, 64), (1, 1), (16384, 480), [(-16384, -480)])",
    ],
)
def test_what_does_not_fit_into_four_gigabytes_is_a_memory_error_with_its_bytes(call: str) -> None:
    kind, message = outcome(call)
    assert kind.startswith("memory ") and " bytes" in message, (kind, message)


def test_a_search_of_an_8k_image_takes_its_pixels_and_four_megabytes_a_thread() -> None:
    program = """
    import resource
    limo_hog.set_num_threads(2)
    hog, image = armed(), people(7680, 4320, channels=1)
    hog.detectMultiScale(image[:1000, :1000].copy(), scale=2.0)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    hog.detectMultiScale(image, scale=2.0)
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print((after - before) // 1024)
    """
    done = run(program, 300)
    assert int(done.stdout) <= 7680 * 4320 / 2**20 + 2 * 4, done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_the_largest_padding_is_answered_or_a_memory_error_in_four_gigabytes() -> None:
    kind, _ = outcome("armed().detectMultiScale(people(64, 128), padding=(16384, 16384))", timeout=3500)
    assert kind in ("answered", "memory MemoryError")


def test_a_small_model_file_cannot_ask_for_gigabytes(tmp_path: Path) -> None:
    file = tmp_path / "huge.xml"
    file.write_text(MODEL)
    kind, message = outcome(f"limo_hog.HOGDescriptor().load({str(file)!r})", timeout=60)
    assert kind == "ModelFormatError" and "huge.xml" in message, (kind, message)


def test_after_a_memory_error_the_same_process_detects_as_before() -> None:
    program = """
    hog, image = armed(), people(128, 256)
    before = hog.detectMultiScale(image, -0.5)
    try:
        fine().detectMultiScale(people(64, 128), padding=(16384, 16384))
    except MemoryError:
        after = hog.detectMultiScale(image, -0.5)
        print(len(before[0]), all(np.array_equal(a, b) for a, b in zip(before, after)))
    """
    done = run(program, 120, FOUR_GB)
    assert done.stdout.split()[1:] == ["True"], done.stdout + done.stderr


def test_after_a_twelve_megapixel_call_no_more_than_twenty_megabytes_are_kept() -> None:
    program = """
    import gc

    def resident():
        return int(open("/proc/self/statm").read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    limo_hog.set_num_threads(2)
    hog, image = armed(), people(4000, 3000)
    hog.detectMultiScale(people(64, 128), scale=1.05)
    idle = resident()
    hog.detectMultiScale(image, 0.5, scale=1.3)
    gc.collect()
    print((resident() - idle) / 1e6)
    """
    if not Path("/proc/self/statm").exists():
        pytest.skip("this system does not show a process's memory in /proc")
    done = run(program, 200)
    assert float(done.stdout or "inf") <= 20, done.stdout + done.stderr
