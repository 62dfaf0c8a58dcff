// The page: a picture, the search in it, and the lesson on the window that was chosen.

import { MODULE, load, pixels } from "./engine.js";
import * as panels from "./panels.js";
import { street } from "./sample.js";

const at = (id) => document.getElementById(id);
const picture = Object.assign(document.createElement("canvas"), { width: 640, height: 480 });
const context = picture.getContext("2d", { willReadFrequently: true });
const crop = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
const MOST_PIXELS = 640 * 480;
const state = { people: [], hits: [], chosen: 0, cell: 0, block: 0, sums: [], shares: [], hit: 0, camera: null };
let engine, texts;

/** A text of en.json with its {names} filled in. */
const say = (key, values = {}) => texts[key].replace(/\{(\w+)\}/g, (_, name) => values[name]);

function settings() {
  const number = (id) => Number(at(id).value);
  return { threshold: number("threshold"), stride: number("stride"), scale: number("scale") };
}

/** Searches the picture, and shows what is found. */
function search() {
  const image = pixels(context);
  const begun = performance.now();
  performance.mark("search-begins");
  state.people = engine.search(image, { ...settings(), padding: 16 });
  performance.measure("search", "search-begins");
  const ms = performance.now() - begun;
  state.people.sort((a, b) => b.weight - a.weight);
  state.chosen = 0;
  const size = `${picture.width} × ${picture.height}`;
  at("found").textContent = say("found", { count: state.people.length, ms: ms.toFixed(0), size });
  listPeople();
  performance.mark("picture-shown");
  clearTimeout(state.lesson);
  if (!state.camera) state.lesson = setTimeout(lesson, 0, image); // people first
}

function listPeople() {
  panels.drawRects(at("picture"), picture, state.people, state.chosen);
  at("people").replaceChildren(
    ...state.people.map((person, index) => {
      const button = document.createElement("button");
      button.textContent = say("person", { index: index + 1, weight: person.weight.toFixed(2) });
      button.setAttribute("aria-pressed", String(index === state.chosen));
      const choose = () => choosePerson(index);
      button.addEventListener("focus", () => panels.drawRects(at("picture"), picture, state.people, index));
      button.addEventListener("click", choose);
      const item = document.createElement("li");
      item.append(button);
      return item;
    }),
  );
}

function choosePerson(index) {
  state.chosen = index;
  panels.drawRects(at("picture"), picture, state.people, index);
  [...at("people").querySelectorAll("button")].forEach((button, i) =>
    button.setAttribute("aria-pressed", String(i === index)),
  );
  lessonOnWindow();
}

/** The steps that concern the whole picture, then those of the chosen window. */
function lesson(image) {
  const { scale } = settings();
  const levels = panels.drawPyramid(at("pyramid"), picture, scale, engine.model);
  at("pyramid-says").textContent = say("pyramid-says", { levels, scale });
  state.hits = engine.search(image, { ...settings(), padding: 16, group: 0 }).sort((a, b) => b.weight - a.weight);
  showHit(0);
  panels.drawRects(at("merged"), picture, state.people);
  at("hits-says").textContent = say("hits-says", { hits: state.hits.length, people: state.people.length });
  lessonOnWindow();
}

/** Marks a hit and tells its margin; the best hit is number 0. */
function showHit(index) {
  state.hit = index;
  panels.drawRects(at("hits"), picture, state.hits, index, 0.5);
  const { x, y, width, height, weight } = state.hits[index] ?? {};
  const values = { index: index + 1, x, y, width, height, weight: weight?.toFixed(2) };
  at("hit-says").textContent = width ? say("hit-says", values) : "";
}

/** The steps from the window's pixels to its margin. */
function lessonOnWindow() {
  const { width, height, weights } = engine.model;
  const middle = { x: picture.width / 2 - width / 2, y: picture.height / 2 - height / 2, width, height };
  const from = state.people[state.chosen] ?? middle;
  Object.assign(crop.canvas, { width, height });
  crop.imageSmoothingQuality = "high";
  crop.drawImage(picture, from.x, from.y, from.width, from.height, 0, 0, width, height);
  const image = pixels(crop);
  const own = at("window").getContext("2d");
  Object.assign(at("window"), { width, height });
  own.drawImage(crop.canvas, 0, 0);
  const votes = engine.gradient(image);
  state.sums = panels.cells(votes, width, height);
  panels.drawGradient(at("gradient"), votes, width, height);
  const descriptor = engine.describe(image);
  state.shares = panels.shares(descriptor, weights, width, height);
  const bias = weights.length > descriptor.length ? weights[descriptor.length] : 0;
  const sum = state.shares.reduce((total, share) => total + share, 0);
  const [numbers, margin] = [descriptor.length, (sum + bias).toFixed(2)];
  at("margin-says").textContent = say("margin-says", { numbers, sum: sum.toFixed(2), bias: bias.toFixed(2), margin });
  const heights = state.sums.map((sum) => Math.max(...sum));
  state.cell = heights.indexOf(Math.max(...heights));
  state.block = state.shares.indexOf(Math.max(...state.shares));
  showCell(state.cell);
  showBlock(state.block);
}

/** Shows a cell's nine numbers, and the four blocks that normalise it. */
function showCell(cell) {
  const { width, height } = engine.model;
  state.cell = cell;
  panels.drawCells(at("cells"), state.sums, width, height, cell);
  const columns = width / 8, [column, row] = [cell % columns, Math.floor(cell / columns)];
  const most = Math.max(...state.sums[cell], 1e-9);
  at("cell-says").textContent = say("cell-says", { row: row + 1, column: column + 1 });
  at("bins").replaceChildren(
    ...[...state.sums[cell]].map((value, bin) => {
      const item = document.createElement("li");
      item.style.setProperty("--share", value / most);
      item.style.setProperty("--hue", panels.hue(bin));
      item.textContent = `${bin * 20}–${bin * 20 + 20}°: ${value.toFixed(0)}`;
      return item;
    }),
  );
  showBlocksOf(row, column, columns, height / 8);
}

function showBlocksOf(row, column, columns, rows) {
  const lengths = [];
  for (const [up, left] of [[1, 1], [1, 0], [0, 1], [0, 0]]) {
    const [top, first] = [row - up, column - left];
    if (top < 0 || first < 0 || top + 1 >= rows || first + 1 >= columns) continue;
    const inside = [[0, 0], [0, 1], [1, 0], [1, 1]].map(([y, x]) => state.sums[(top + y) * columns + first + x]);
    const length = Math.hypot(...inside.flatMap((sum) => [...sum]));
    const highest = Math.max(...state.sums[row * columns + column]);
    lengths.push(say("block-says", { length: length.toFixed(0), part: (highest / (length || 1)).toFixed(2) }));
  }
  at("blocks").replaceChildren(...lengths.map((text) => Object.assign(document.createElement("li"), { textContent: text })));
}

function showBlock(block) {
  const { width, height } = engine.model;
  state.block = block;
  panels.drawShares(at("shares"), state.shares, width, height, block);
  const columns = width / 8 - 1, share = state.shares[block].toFixed(3);
  at("share-says").textContent = say("share-says", { row: Math.floor(block / columns) + 1, column: (block % columns) + 1, share });
}

/** Lets one of `count()` things on a canvas be chosen: the one that `find` names, given where the pointer is as shares of
 * the canvas, or one or a row of `columns()` further by the arrow keys. */
function choice(canvas, find, columns, count, chosen, show) {
  const point = ({ clientX, clientY }) => {
    const box = canvas.getBoundingClientRect();
    const index = find((clientX - box.left) / box.width, (clientY - box.top) / box.height);
    if (index >= 0 && index < count() && index !== chosen()) show(index);
  };
  canvas.addEventListener("pointermove", point);
  canvas.addEventListener("pointerdown", point);
  canvas.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -columns(), ArrowDown: columns() }[event.key];
    if (!step) return;
    event.preventDefault();
    const next = chosen() + step;
    if (next >= 0 && next < count()) show(next);
  });
}

/** A choice of one of the squares of a grid. */
function grid(canvas, columns, count, chosen, show) {
  const find = (x, y) => Math.floor((y * count()) / columns()) * columns() + Math.floor(x * columns());
  choice(canvas, find, columns, count, chosen, show);
}

/** Of `rects` around a point of the picture, given as shares of it, the one whose middle is nearest; -1 if there is none. */
function nearest(rects, x, y) {
  const off = (r) => Math.max(...[[x * picture.width - r.x, r.width], [y * picture.height - r.y, r.height]]
    .map(([inside, side]) => Math.abs((2 * inside) / side - 1)));
  const offs = rects.map(off);
  const least = Math.min(...offs);
  return least <= 1 ? offs.indexOf(least) : -1;
}

/** Takes a picture, shrunk to at most 640 × 480 px in area. */
function take(source, width, height) {
  const factor = Math.min(1, Math.sqrt(MOST_PIXELS / (width * height)));
  Object.assign(picture, { width: Math.round(width * factor), height: Math.round(height * factor) });
  context.drawImage(source, 0, 0, picture.width, picture.height);
  search();
}

async function takeFile(file) {
  try {
    const bitmap = await createImageBitmap(file);
    stopCamera();
    take(bitmap, bitmap.width, bitmap.height);
  } catch {
    at("found").textContent = say("no-picture", { name: file.name });
  }
}

function stopCamera() {
  state.camera?.getTracks().forEach((track) => track.stop());
  state.camera = null;
  at("camera").textContent = say("camera");
}

async function toggleCamera() {
  if (state.camera) {
    stopCamera();
    return lesson(pixels(context));
  }
  try {
    state.camera = await navigator.mediaDevices.getUserMedia({ video: { width: 640, height: 480 } });
  } catch {
    at("found").textContent = say("no-camera");
    return;
  }
  at("camera").textContent = say("camera-stop");
  const video = Object.assign(document.createElement("video"), { srcObject: state.camera, muted: true, playsInline: true });
  await video.play();
  const next = () => {
    if (!state.camera) return;
    take(video, video.videoWidth, video.videoHeight);
    requestAnimationFrame(next);
  };
  next();
}

function wire() {
  for (const id of ["threshold", "stride", "scale"]) {
    at(id).addEventListener("input", () => {
      at(`${id}-value`).textContent = at(id).value;
      search();
    });
  }
  at("model").addEventListener("change", async () => {
    await engine.choose(at("model").value);
    search();
  });
  at("file").addEventListener("change", () => at("file").files[0] && takeFile(at("file").files[0]));
  at("camera").addEventListener("click", toggleCamera);
  at("sample").addEventListener("click", sample);
  addEventListener("dragover", (event) => event.preventDefault());
  addEventListener("drop", (event) => {
    event.preventDefault();
    if (event.dataTransfer.files[0]) takeFile(event.dataTransfer.files[0]);
  });
  const columns = () => engine.model.width / 8;
  grid(at("cells"), columns, () => state.sums.length, () => state.cell, showCell);
  grid(at("shares"), () => columns() - 1, () => state.shares.length, () => state.block, showBlock);
  choice(at("hits"), (x, y) => nearest(state.hits, x, y), () => 1, () => state.hits.length, () => state.hit, showHit);
  at("picture").addEventListener("click", ({ offsetX, offsetY, target }) => {
    const index = nearest(state.people, offsetX / target.clientWidth, offsetY / target.clientHeight);
    if (index >= 0) choosePerson(index);
  });
}

function sample() {
  stopCamera();
  drawStreet();
  search();
}

function drawStreet() {
  Object.assign(picture, { width: 640, height: 480 });
  street(context);
}

async function begin() {
  drawStreet();
  panels.drawRects(at("picture"), picture, []);
  performance.mark("picture-drawn");
  const words = fetch(new URL("en.json", import.meta.url)).then((file) => file.json());
  engine = await load();
  [texts] = await Promise.all([words, engine.choose("limo")]);
  document.querySelectorAll("[data-text]").forEach((element) => (element.textContent = texts[element.dataset.text]));
  document.querySelectorAll("[data-label]").forEach((element) => element.setAttribute("aria-label", texts[element.dataset.label]));
  wire();
  search();
  window.lab = engine; // for the tests, and for the curious
  document.body.dataset.ready = "yes";
  if ("serviceWorker" in navigator && location.protocol.startsWith("http")) navigator.serviceWorker.register(`sw.js?module=${MODULE}`);
}

begin().catch((error) => (at("found").textContent = String(error)));
