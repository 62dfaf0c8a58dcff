# /// script
# requires-python = ">=3.11"
# dependencies = ["jax>=0.7", "limo-hog", "numpy", "opencv-python-headless>=4.8,<5", "optax>=0.2"]
# [tool.uv.sources]
# limo-hog = { path = ".." }
# ///
"""Trains the network of the detector's second look, and measures it; docs/models.md says where the data is.

    uv run --script benches/second_look.py --people inria/positive mit/Positive --crops inria/negative \
        --photographs photographs/images --data ../shared/data --frames TUD --out second_look.f16

writes the weights (float16, little-endian) and beside them a card. All that is drawn comes from `--seed`.
The windows that `limo` takes for people on the photographs are mined first and kept in `--mined`, if that is named.
Weights that are there are not trained again: only their card is made.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import time
from collections.abc import Iterator
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import cv2
import jax
import jax.numpy as jnp
import numpy as np
import optax
from numpy.typing import NDArray

from limo_hog import PeopleDetector, __version__
from limo_hog.learn.card import calibrate, calibration_error
from limo_hog.learn.evaluation.run import Evaluation, Rival, evaluate
from limo_hog.learn.sources import hash_of
from limo_hog.models import Calibration, SecondLook, load_model
from limo_hog.suppression import nms
from rivals import tud, usc

#: The first look: the large window, which alone serves people from 64 px on.
LIMO = load_model(files("limo_hog") / "weights" / "limo_64x128.yml")
#: Share of the logit in a score, of .05 to .3 the best on USC-C and TUD 1-41 together; where measured curves end.
SHARE, LEAST_SCORE = 0.15, -1.5

#: The window [px], and the margin around it that jitter may show.
WIDTH, HEIGHT, MARGIN = 64, 128, 8
SOURCE = WIDTH + 2 * MARGIN, HEIGHT + 2 * MARGIN * 2
#: The network's input, and its layers: channels of three convolutions of stride 2, and units of the dense layer.
INPUT = 32, 64
CHANNELS, KERNELS = (16, 32, 64), (5, 3, 3)
HIDDEN = 16
#: Mined: least margin, most windows of a photograph, most overlap (IoU) of two.
LEAST_MARGIN, MOST, MOST_IOU = -1.3, 25, 0.7
#: An epoch: people, negatives for each, share of these that are parts of people, and from epoch HARD_FROM on of the
#: others the share of the hardest.
PEOPLE, NEGATIVES, PARTS, HARDEST, HARD_FROM = 8192, 3, 1 / 6, 0.5, 2
BATCH, RATE, DECAY, DROPOUT, SURE = 256, 2e-3, 0.02, 0.4, 0.99

Images = NDArray[np.uint8]
Params = dict[str, jax.Array]


def main() -> None:
    """Mine, train and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--people", type=Path, nargs="+", required=True, help="folders of 64 x 128 crops of people")
    parser.add_argument("--crops", type=Path, required=True, help="a folder of such crops without people")
    parser.add_argument("--photographs", type=Path, required=True, help="a folder of photographs without people")
    parser.add_argument("--mined", type=Path, help="file in which the mined windows are kept (.npy)")
    parser.add_argument("--data", type=Path, required=True, help="with eval/usc-c and real/annotations")
    parser.add_argument("--frames", type=Path, required=True, help="frames 1 to 41 of TUD-Stadtmitte")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--epochs", type=int, default=16)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    if not args.out.exists():
        args.out.write_bytes(learnt(args))
    weights = args.out.read_bytes()
    card = {
        "made_by": f"benches/second_look.py of limo-hog {__version__}",
        "layers": [*CHANNELS, HIDDEN],
        "sha256": hashlib.sha256(weights).hexdigest(),
        **measured(weights, args.data, args.frames),
        "data": [source(folder) for folder in (*args.people, args.crops, args.photographs)],
        "seed": args.seed,
        "epochs": args.epochs,
    }
    args.out.with_name(f"{args.out.name}.json").write_text(json.dumps(card, indent=2) + "\n")
    print(card["figures"])


def learnt(args: argparse.Namespace) -> bytes:
    """Mine and train."""
    people = np.unique(np.concatenate([crops(folder) for folder in args.people]), axis=0)
    if args.mined is not None and args.mined.exists():
        mined = np.load(args.mined)
    else:
        mined = np.stack(list(mine(args.photographs)))
        if args.mined is not None:
            np.save(args.mined, mined)
    negatives = np.concatenate([crops(args.crops), mined])
    print(f"{len(people)} people, {len(negatives)} negatives, {len(mined)} of them mined", flush=True)
    params = train(people, negatives, args.epochs, args.seed)
    # (jax sorts a dictionary's keys, which puts a bias before its weights.)
    ordered = [np.asarray(params[f"{layer}{kind}"]).ravel() for layer in range(5) for kind in "wb"]
    return np.concatenate(ordered).astype("<f2").tobytes()


def source(folder: Path) -> dict[str, Any]:
    """Say what was learnt from, as the cards of `limo-hog train` do."""
    paths = [path for path in folder.iterdir() if path.is_file()]
    return {"name": folder.name, "files": len(paths), "sha256": hash_of(paths, folder)}


def measured(weights: bytes, data: Path, frames: Path) -> dict[str, Any]:
    """Return share, threshold (.1 false positives an image of USC-C), calibration (Platt, on both sets) and figures."""

    def figures(name: str, pictures: list[Any], min_height: int, look: SecondLook) -> Evaluation:
        detector = PeopleDetector(
            model=replace(LIMO, second_look=look), min_height=min_height, threshold=LEAST_SCORE, second_look=True
        )
        return evaluate([Rival(name, detector)], pictures)[1][0]

    look = SecondLook(CHANNELS, HIDDEN, weights, SHARE, LEAST_SCORE, Calibration(1.0, 0.0))
    evaluations = [figures("USC-C", usc(data), 64, look), figures("TUD 1-41", tud(data, frames), 96, look)]
    scores = np.concatenate([evaluation.outcomes.scores for evaluation in evaluations])
    right = np.concatenate([evaluation.outcomes.right for evaluation in evaluations])
    calibration = calibrate(scores, right)
    return {
        "share": SHARE,
        "threshold": round(evaluations[0].threshold_01, 4),
        "calibration": calibration._asdict(),
        "figures": {
            **{each.name: figures_of(each) for each in evaluations},
            "calibration_error": round(calibration_error(calibration.probabilities(scores), right), 4),
        },
    }


def figures_of(evaluation: Evaluation) -> dict[str, Any]:
    """Return an evaluation's log-average miss rate and its interval."""
    return {"lamr": round(evaluation.figures.lamr, 4), "lamr_interval": evaluation.intervals["lamr"]}


def crops(folder: Path) -> Images:
    """Return the crops of a folder, gray, mirrored beyond their edges: (N, 160, 80)."""
    found = []
    for path in sorted(folder.iterdir()):
        image = gray(path)
        if image.shape != (HEIGHT, WIDTH):
            image = cv2.resize(image, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
        found.append(np.pad(image, ((2 * MARGIN,) * 2, (MARGIN,) * 2), "reflect"))
    return np.stack(found)


def gray(path: Path) -> Images:
    """Read a picture as the second look sees it: the mean of its channels."""
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise SystemExit(f"{path}: no picture")
    return np.rint(image.mean(axis=2)).astype(np.uint8)


def mine(folder: Path) -> Iterator[Images]:
    """Yield what `limo` takes for people, with a margin: (160, 80)."""
    # Grouped by 0, every hit is returned.
    detector = PeopleDetector(model=LIMO, threshold=LEAST_MARGIN, nms="group", group_threshold=0)
    for path in sorted(folder.iterdir()):
        image = gray(path)
        found = detector.detect(image)
        for box in found.windows[nms(found.windows, found.scores, MOST_IOU)[:MOST]]:
            yield cut(image, box)


def cut(image: Images, box: NDArray[np.int32]) -> Images:
    """Cut a window out of a picture with a margin of an eighth at each side, mirrored beyond the edges."""
    sides = []
    for at, length, whole in zip(box[:2], box[2:], image.shape[::-1], strict=True):
        margin = round(length / 8)
        places = np.abs(np.arange(at - margin, at + length + margin))
        sides.append((whole - 1) - np.abs((whole - 1) - places) if whole > 1 else places * 0)
    region = np.ascontiguousarray(image[np.ix_(np.abs(sides[1]), np.abs(sides[0]))])
    way = cv2.INTER_AREA if region.shape[1] > SOURCE[0] else cv2.INTER_LINEAR
    return cv2.resize(region, SOURCE, interpolation=way)


def drawn(sources: Images, at: NDArray[np.intp], parts: bool, rng: np.random.Generator) -> NDArray[np.float32]:
    """Return these sources, varied as the search, light and cameras vary them: (N, 64, 32), normalised."""
    size = np.exp(rng.uniform(math.log(0.94), math.log(1.06), len(at)))
    shift = rng.uniform(-5, 5, (len(at), 2))
    if parts:
        near = rng.random(len(at)) < 0.6
        side = np.where(near, rng.uniform(0.4, 0.7, len(at)), rng.uniform(0.8, 1.3, len(at)))
        size = 1 / side
        free = (1 - side)[:, None] * np.array([WIDTH, HEIGHT]) / 2
        way = rng.uniform(0, 2 * math.pi, len(at))
        off = rng.uniform(0.32, 0.5, len(at))
        away = np.stack([off * WIDTH * np.cos(way), off * HEIGHT * np.sin(way)], 1)
        shift = np.where(near[:, None], rng.uniform(-1, 1, (len(at), 2)) * free, away)
    flip = np.where(rng.random(len(at)) < 0.5, -1.0, 1.0)
    sigma = np.where(rng.random(len(at)) < 0.3, rng.uniform(0.5, 1.2, len(at)), 0.0)
    out = np.empty((len(at), INPUT[1], INPUT[0]), np.float32)
    hidden = rng.random(len(at)) < 0.25
    rectangle = rng.random((len(at), 5))
    for i, index in enumerate(at):
        a, d = flip[i] / size[i], 1 / size[i]
        middle = np.array(SOURCE) / 2 - 0.5 + shift[i]
        matrix = np.array(
            [[a, 0, middle[0] - a * (WIDTH / 2 - 0.5)], [0, d, middle[1] - d * (HEIGHT / 2 - 0.5)]], np.float32
        )
        warped = cv2.warpAffine(
            sources[index], matrix, (WIDTH, HEIGHT), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REFLECT_101,
        )  # fmt: skip
        if sigma[i]:
            warped = cv2.GaussianBlur(warped, (0, 0), sigma[i])
        small = cv2.resize(warped, INPUT, interpolation=cv2.INTER_AREA)
        if hidden[i]:
            w, h = int(4 + 16 * rectangle[i, 0]), int(4 + 24 * rectangle[i, 1])
            x, y = int((INPUT[0] - w) * rectangle[i, 2]), int((INPUT[1] - h) * rectangle[i, 3])
            small[y : y + h, x : x + w] = int(255 * rectangle[i, 4])
        out[i] = small
    one = (len(at), 1, 1)
    out = out * rng.uniform(0.6, 1.5, one).astype(np.float32) + rng.uniform(-25, 25, one).astype(np.float32)
    out += 2 * rng.standard_normal(out.shape, np.float32)
    return normalised(np.clip(out, 0, 255))


def normalised(inputs: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return each less its mean, over its deviation and 8."""
    mean, deviation = inputs.mean(axis=(1, 2), keepdims=True), inputs.std(axis=(1, 2), keepdims=True)
    return (inputs - mean) / (deviation + 8)


def begin(rng: np.random.Generator) -> Params:
    """Return a network to begin with (He 2015)."""
    params, before = {}, 1
    for i, (kernel, channels) in enumerate(zip(KERNELS, CHANNELS, strict=True)):
        shape = (kernel, kernel, before, channels)
        params[f"{i}w"] = rng.standard_normal(shape) * math.sqrt(2 / (kernel * kernel * before))
        params[f"{i}b"] = np.zeros(channels)
        before = channels
    cells = (INPUT[0] // 8) * (INPUT[1] // 8) * before
    params["3w"], params["3b"] = rng.standard_normal((cells, HIDDEN)) * math.sqrt(2 / cells), np.zeros(HIDDEN)
    params["4w"], params["4b"] = rng.standard_normal((HIDDEN, 1)) * math.sqrt(1 / HIDDEN), np.zeros(1)
    return {name: jnp.asarray(value, jnp.float32) for name, value in params.items()}


def logits(params: Params, inputs: jax.Array, key: jax.Array | None = None) -> jax.Array:
    """Return the network's answers (N,) to inputs (N, 64, 32); with a key, as in training."""
    x = inputs[..., None]
    for i, kernel in enumerate(KERNELS):
        count, rows, columns, _ = x.shape
        side = (kernel // 2, kernel // 2 - 1)
        x = jnp.pad(x, ((0, 0), side, side, (0, 0)))
        # As one product of matrices, which takes less time here than a convolution.
        shifted = [x[:, dy : dy + rows : 2, dx : dx + columns : 2] for dy in range(kernel) for dx in range(kernel)]
        x = jnp.concatenate(shifted, axis=-1).reshape(count * rows * columns // 4, -1)
        x = jax.nn.relu(x @ params[f"{i}w"].reshape(x.shape[1], -1) + params[f"{i}b"])
        x = x.reshape(count, rows // 2, columns // 2, -1)
    x = x.reshape(len(x), -1)
    if key is not None:
        x = jnp.where(jax.random.bernoulli(key, 1 - DROPOUT, x.shape), x / (1 - DROPOUT), 0)
    x = jax.nn.relu(x @ params["3w"] + params["3b"])
    return (x @ params["4w"] + params["4b"])[:, 0]


def train(people: Images, negatives: Images, epochs: int, seed: int) -> Params:
    """Return a trained network."""
    rng = np.random.default_rng(seed)
    params = begin(rng)
    steps = epochs * PEOPLE * (1 + NEGATIVES) // BATCH
    optimiser = optax.adamw(optax.cosine_decay_schedule(RATE, steps), weight_decay=DECAY)

    @jax.jit
    def step(params: Params, state: Any, inputs: jax.Array, wanted: jax.Array, key: jax.Array) -> Any:
        def loss(params: Params) -> tuple[jax.Array, jax.Array]:
            answers = logits(params, inputs, key)
            return optax.sigmoid_binary_cross_entropy(answers, wanted).mean(), answers

        (value, answers), slope = jax.value_and_grad(loss, has_aux=True)(params)
        change, state = optimiser.update(slope, state, params)
        return optax.apply_updates(params, change), state, value, answers

    state, began = optimiser.init(params), time.monotonic()
    count = PEOPLE * NEGATIVES
    # The newest answer to each negative: the hardest are those that are taken for people.
    newest = np.full(len(negatives), -np.inf, np.float32)
    for epoch in range(epochs):
        few = round(PARTS * count)
        at = rng.integers(len(negatives), size=count - few)
        if epoch >= HARD_FROM:
            hard = round(HARDEST * len(at))
            at[:hard] = np.argsort(-newest, kind="stable")[:hard]
        order = np.concatenate([rng.permutation(len(people)) for _ in range(-(-PEOPLE // len(people)))])[:PEOPLE]
        inputs = np.concatenate(
            [
                drawn(people, order, False, rng),
                drawn(negatives, at, False, rng),
                drawn(people, rng.integers(len(people), size=few), True, rng),
            ]
        )
        wanted = np.where(np.arange(len(inputs)) < PEOPLE, SURE, 1 - SURE).astype(np.float32)
        losses = []
        for batch in rng.permutation(len(inputs)).reshape(-1, BATCH):
            key = jax.random.key(int(rng.integers(2**31)))
            params, state, value, answers = step(params, state, inputs[batch], wanted[batch], key)
            losses.append(value)
            own = (batch >= PEOPLE) & (batch < PEOPLE + len(at))
            newest[at[batch[own] - PEOPLE]] = np.asarray(answers)[own]
        print(f"epoch {epoch + 1}: loss {np.mean(losses):.4f}, {time.monotonic() - began:.0f} s", flush=True)
    return params


if __name__ == "__main__":
    main()
