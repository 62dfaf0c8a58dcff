# /// script
# requires-python = ">=3.11"
# dependencies = ["jax>=0.7", "limo-hog[train]", "numpy", "opencv-python-headless>=4.8,<5", "optax>=0.2"]
# [tool.uv.sources]
# limo-hog = { path = ".." }
# ///
"""Trains the network of the detector's second look, and measures it; docs/models.md says where the data is.

    uv run --script benches/second_look.py --people inria/positive mit/Positive --crops inria/negative \
        --photographs photographs/images --streets motion-pairs --data ../shared/data --frames TUD --out second_look.f16

writes the weights (float16, little-endian) and beside them a card. All that is drawn comes from `--seed`.
First the windows are mined that `limo` takes for people on photographs, and on parts of people on streets.
Weights that are there are not trained again: only their card is made.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
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
from limo_hog.learn.formats import read_labels
from limo_hog.learn.sources import hash_of
from limo_hog.models import PERSON_BOX, Calibration, SecondLook, load_model
from limo_hog.suppression import intersection_over_union, nms, share_inside
from rivals import tud, usc

#: The first look: the large window, which alone serves people from 64 px on.
LIMO = load_model(files("limo_hog") / "weights" / "limo_64x128.yml")
#: Share of the logit in a score, of .05 to .3 the best on USC-C and TUD 1-41 together; where measured curves end.
SHARE, LEAST_SCORE = 0.2, -1.5

#: The window [px], and the margin around it that jitter may show.
WIDTH, HEIGHT, MARGIN = 64, 128, 8
SOURCE = WIDTH + 2 * MARGIN, HEIGHT + 2 * MARGIN * 2
#: The network's input, and its layers: channels of three convolutions of stride 2, and units of the dense layer.
INPUT = 32, 64
CHANNELS, KERNELS = (16, 32, 64), (5, 3, 3)
HIDDEN = 32
#: Mined: least margin, most windows of a photograph and of a street, most overlap (IoU) of two.
LEAST_MARGIN, MOST, MOST_OF_STREET, MOST_IOU = -1.3, 25, 60, 0.7
#: The streets: size of the pictures that belong to them [px], least height of a person [px], and bounds of a person's
#: width [heights]; a window on a labelled person (share inside) that is not the person's (IoU) shows a part.
STREET, TALL, SLIM, INSIDE, NOT_THE_PERSON = (720, 576), 70, (0.2, 0.62), 0.7, 0.3
#: Height of a person in a window of INRIA's and MIT's [px], and of the streets', and how far below its upper edge.
PERSON, STREET_PERSON, ABOVE = 96, 0.76, 0.12
#: An epoch: people, negatives for each, shares of these that are cut out of people, and that are parts found on the
#: streets, from epoch HARD_FROM on of the others the share of the hardest; and people for their places alone.
PEOPLE, NEGATIVES, PARTS, FOUND_PARTS, HARDEST, HARD_FROM, PLACES = 8192, 3, 1 / 4, 1 / 6, 0.5, 2, 4096
#: Weights below the first are stored as 0, all others with this many bits of mantissa.
LEAST_WEIGHT, MANTISSA_BITS = 0.007, 3
BATCH, RATE, DECAY, DROPOUT, SURE, LARGEST_STEP = 256, 2e-3, 0.02, 0.4, 0.99, 1.0
#: How much the places' loss counts, and where it passes from squares to lines.
PLACE_SHARE, PLACE_SQUARE = 0.05, 0.1

Images = NDArray[np.uint8]
Params = dict[str, jax.Array]


@dataclass(frozen=True)
class People:
    """Crops (N, 160, 80), and each person (N, 4): right and down of the middle, width (NaN: unknown), height [px]."""

    crops: Images
    places: NDArray[np.float32]


def main() -> None:
    """Mine, train and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--people", type=Path, nargs="+", required=True, help="folders of 64 x 128 crops of people")
    parser.add_argument("--crops", type=Path, required=True, help="a folder of such crops without people")
    parser.add_argument("--photographs", type=Path, required=True, help="a folder of photographs without people")
    parser.add_argument("--streets", type=Path, required=True, help="with JPEGImages, and people in Annotations (VOC)")
    parser.add_argument("--data", type=Path, required=True, help="with eval/usc-c and real/annotations")
    parser.add_argument("--frames", type=Path, required=True, help="frames 1 to 41 of TUD-Stadtmitte")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--epochs", type=int, default=20)
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
        "streets": [source(args.streets / folder) for folder in ("JPEGImages", "Annotations")],
        "seed": args.seed,
        "epochs": args.epochs,
    }
    args.out.with_name(f"{args.out.name}.json").write_text(json.dumps(card, indent=2) + "\n")
    print(card["figures"])


def learnt(args: argparse.Namespace) -> bytes:
    """Mine and train."""
    plain = np.unique(np.concatenate([crops(folder) for folder in args.people]), axis=0)
    walking, parts = streets(args.streets)
    people = People(
        np.concatenate([plain, walking.crops]),
        np.concatenate([np.tile(np.float32([0, 0, np.nan, PERSON]), (len(plain), 1)), walking.places]),
    )
    negatives = np.concatenate([crops(args.crops), np.stack(list(mine(args.photographs))), parts])
    print(f"{len(people.crops)} people, {len(negatives)} negatives, {len(parts)} of them parts of people", flush=True)
    params = train(people, negatives, len(parts), args.epochs, args.seed)
    # (jax sorts a dictionary's keys, which puts a bias before its weights.)
    ordered = [np.asarray(params[f"{layer}{kind}"]).ravel() for layer in range(5) for kind in "wb"]
    return rounded(np.concatenate(ordered)).tobytes()


def rounded(weights: NDArray[np.float32]) -> NDArray[np.float16]:
    """Return them so that a wheel packs them in half as many bytes; LAMR stays within .005."""
    small = np.where(np.abs(weights) < LEAST_WEIGHT, 0, weights).astype("<f2").view("<u2").astype(np.uint32)
    dropped = 10 - MANTISSA_BITS
    return ((small + (1 << (dropped - 1)) >> dropped) << dropped).astype("<u2").view("<f2")


def streets(folder: Path) -> tuple[People, Images]:
    """Return the people of the streets, seen whole, and windows that `limo` finds on parts of them."""
    whole, places, parts = [], [], []
    for picture in read_labels(folder, folder / "JPEGImages"):
        image = gray(picture.path)
        boxes = [(box.x, box.y, box.width, box.height) for box in picture.boxes if box.label == "person"]
        if image.shape[::-1] != STREET or not boxes:
            continue
        for x, y, w, h in boxes:
            is_inside = x > 2 and y > 2 and x + w < STREET[0] - 3 and y + h < STREET[1] - 3
            if h < TALL or not SLIM[0] <= w / h <= SLIM[1] or not is_inside:
                continue
            height = h / STREET_PERSON
            window = np.rint([x + w / 2 - height / 4, y - ABOVE * height, height / 2, height]).astype(np.int32)
            whole.append(cut(image, window))
            right, down = x + w / 2 - window[0], y + h / 2 - window[1]
            across, along = WIDTH / window[2], HEIGHT / window[3]
            places.append((right * across - WIDTH / 2, down * along - HEIGHT / 2, w * across, h * along))
        windows = windows_in(image, MOST_OF_STREET)
        people, there = PERSON_BOX.inside(windows), np.array(boxes)
        is_part = intersection_over_union(people, there).max(axis=1, initial=0) < NOT_THE_PERSON
        is_part &= share_inside(people, there).max(axis=1, initial=0) > INSIDE
        parts += [cut(image, window) for window in windows[is_part]]
    return People(np.stack(whole), np.array(places, np.float32)), np.stack(parts)


def source(folder: Path) -> dict[str, Any]:
    """Say what was learnt from, as the cards of `limo-hog train` do."""
    paths = [path for path in folder.iterdir() if path.is_file()]
    return {"name": folder.name, "files": len(paths), "sha256": hash_of(paths, folder)}


def measured(weights: bytes, data: Path, frames: Path) -> dict[str, Any]:
    """Return share, threshold (.1 false positives an image of USC-C), calibration (Platt, on both sets) and figures."""

    def figures(name: str, pictures: list[Any], min_height: int, look: SecondLook) -> Evaluation:
        detector = PeopleDetector(model=replace(LIMO, second_look=look), min_height=min_height, threshold=LEAST_SCORE)
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
            **{
                each.name: {"lamr": round(each.figures.lamr, 4), "lamr_interval": each.intervals["lamr"]}
                for each in evaluations
            },
            "calibration_error": round(calibration_error(calibration.probabilities(scores), right), 4),
        },
    }


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
    for path in sorted(folder.iterdir()):
        image = gray(path)
        for window in windows_in(image, MOST):
            yield cut(image, window)


def windows_in(image: Images, most: int) -> NDArray[np.int32]:
    """Return the windows that `limo` takes for people, best first: (N, 4) x, y, w, h [px]."""
    # Grouped by 0, every hit is returned.
    found = PeopleDetector(model=LIMO, threshold=LEAST_MARGIN, nms="group", group_threshold=0).detect(image)
    return found.windows[nms(found.windows, found.scores, MOST_IOU)[:most]]


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


def drawn(
    sources: Images,
    at: NDArray[np.intp],
    rng: np.random.Generator,
    kind: str = "as found",
    places: NDArray[np.float32] | None = None,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return these sources, varied as the search, light and cameras vary them, and where the people stand.

    `kind`: "as found" by the search; "parts" of people, or people off the middle; "off": by as much as windows are that
    still find the person. Inputs are (N, 64, 32), normalised; places (N, 4) as the network answers, NaN: unknown.
    """
    size = np.exp(rng.uniform(math.log(0.94), math.log(1.06), len(at)))
    shift = rng.uniform(-5, 5, (len(at), 2))
    if kind == "off":
        size = np.exp(rng.uniform(math.log(0.78), math.log(1.28), len(at)))
        shift = rng.uniform(-1, 1, (len(at), 2)) * (9, 15)
    if kind == "parts":
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
    where = np.full((len(at), 4), np.nan, np.float32)
    if places is not None:
        right, down, width, height = places[at].T
        where[:, 0] = (right - shift[:, 0]) * size * flip / WIDTH + (0.5 - PERSON_BOX.x - PERSON_BOX.width / 2)
        where[:, 1] = (down - shift[:, 1]) * size / HEIGHT + (0.5 - PERSON_BOX.y - PERSON_BOX.height / 2)
        where[:, 2] = np.log(width * size / (PERSON_BOX.width * WIDTH))
        where[:, 3] = np.log(height * size / (PERSON_BOX.height * HEIGHT))
    return normalised(np.clip(out, 0, 255)), where


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
    params["4w"], params["4b"] = rng.standard_normal((HIDDEN, 5)) * math.sqrt(1 / HIDDEN), np.zeros(5)
    return {name: jnp.asarray(value, jnp.float32) for name, value in params.items()}


def answers(params: Params, inputs: jax.Array, key: jax.Array | None = None) -> jax.Array:
    """Return the network's answers (N, 5) to inputs (N, 64, 32); with a key, as in training."""
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
    return x @ params["4w"] + params["4b"]


def train(people: People, negatives: Images, parts: int, epochs: int, seed: int) -> Params:
    """Return a trained network; the last `parts` of the negatives are parts of people."""
    rng = np.random.default_rng(seed)
    params = begin(rng)
    count = PEOPLE * NEGATIVES
    steps = epochs * ((PEOPLE + count + PLACES) // BATCH)
    schedule = optax.cosine_decay_schedule(RATE, steps)
    optimiser = optax.chain(optax.clip_by_global_norm(LARGEST_STEP), optax.adamw(schedule, weight_decay=DECAY))

    @jax.jit
    def step(params: Params, state: Any, inputs: jax.Array, wanted: jax.Array, where: jax.Array, key: jax.Array) -> Any:
        def loss(params: Params) -> tuple[jax.Array, tuple[jax.Array, ...]]:
            found = answers(params, inputs, key)
            is_told, is_known = jnp.isfinite(wanted), jnp.isfinite(where)
            of_logits = optax.sigmoid_binary_cross_entropy(found[:, 0], jnp.where(is_told, wanted, 0))
            opinion = jnp.where(is_told, of_logits, 0).sum() / is_told.sum()
            off = jnp.where(is_known, found[:, 1:] - jnp.where(is_known, where, 0), 0)
            place = optax.losses.huber_loss(off / PLACE_SQUARE).sum(axis=1).mean()
            return opinion + PLACE_SHARE * place, (opinion, place, found[:, 0])

        (_, told), slope = jax.value_and_grad(loss, has_aux=True)(params)
        change, state = optimiser.update(slope, state, params)
        return optax.apply_updates(params, change), state, told

    state, began = optimiser.init(params), time.monotonic()
    # The newest answer to each negative: the hardest are those that are taken for people.
    newest = np.full(len(negatives), -np.inf, np.float32)
    cut_out, found_parts = round(PARTS * count), round(FOUND_PARTS * count)
    wanted = np.repeat(np.float32([SURE, 1 - SURE, np.nan]), [PEOPLE, count, PLACES])
    for epoch in range(epochs):
        at = rng.integers(len(negatives), size=count - cut_out)
        at[-found_parts:] = len(negatives) - parts + rng.integers(parts, size=found_parts)
        if epoch >= HARD_FROM:
            hard = round(HARDEST * len(at))
            at[:hard] = np.argsort(-newest, kind="stable")[:hard]
        every = len(people.crops)
        order = np.concatenate([rng.permutation(every) for _ in range(-(-PEOPLE // every))])[:PEOPLE]
        inputs, where = (
            np.concatenate(drawings)
            for drawings in zip(
                drawn(people.crops, order, rng, places=people.places),
                drawn(negatives, at, rng),
                drawn(people.crops, rng.integers(every, size=cut_out), rng, "parts"),
                drawn(people.crops, rng.integers(every, size=PLACES), rng, "off", people.places),
                strict=True,
            )
        )
        losses = []
        for batch in rng.permutation(len(inputs)).reshape(-1, BATCH):
            key = jax.random.key(int(rng.integers(2**31)))
            params, state, told = step(params, state, inputs[batch], wanted[batch], where[batch], key)
            losses.append(told[:2])
            own = (batch >= PEOPLE) & (batch < PEOPLE + len(at))
            newest[at[batch[own] - PEOPLE]] = np.asarray(told[2])[own]
        opinion, place = np.mean(losses, axis=0)
        print(f"epoch {epoch + 1}: losses {opinion:.4f}, {place:.4f}, {time.monotonic() - began:.0f} s", flush=True)
    return params


if __name__ == "__main__":
    main()
