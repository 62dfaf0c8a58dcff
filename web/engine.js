// The detector: hog.wasm or, for browsers without vectors, hog-scalar.wasm, with numbers in and numbers out (crates/hog_web/src/lib.rs).

const MODELS = {
  limo: { file: "limo_64x128.f32", width: 64, height: 128, gamma: 1 },
  "limo-small": { file: "limo_48x96.f32", width: 48, height: 96, gamma: 1 },
  opencv: { which: 0, width: 64, height: 128, gamma: 1 },
  daimler: { which: 1, width: 48, height: 96, gamma: 1 },
};

// A module of one vector instruction, which browsers without simd128 refuse.
const VECTOR = Uint8Array.of(
  0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 10, 1, 8, 0, 65, 0, 253, 15, 253, 98, 11,
);

/** The detector's file that this browser can run. */
export const MODULE = WebAssembly.validate(VECTOR) ? "hog.wasm" : "hog-scalar.wasm";

/** Loads the detector from beside this file. */
export async function load() {
  const { instance } = await WebAssembly.instantiateStreaming(fetch(new URL(MODULE, import.meta.url)));
  return new Engine(instance.exports);
}

class Engine {
  constructor(wasm) {
    this.wasm = wasm;
  }

  /** The numbers that a call left; an Error with the detector's reason if it refused. */
  #results(count) {
    if (count < 0) {
      const length = this.wasm.error();
      throw new Error(String.fromCharCode(...this.#view(length)));
    }
    return this.#view(count).slice();
  }

  #view(count) {
    return new Float64Array(this.wasm.memory.buffer, this.wasm.results(), count);
  }

  #write(bytes) {
    const at = this.wasm.room(bytes.length);
    new Uint8Array(this.wasm.memory.buffer, at, bytes.length).set(bytes);
  }

  /** Chooses a model by name; it is then at `model`, with its weights, bias last. */
  async choose(name) {
    const model = { name, ...MODELS[name] };
    if (model.file) {
      const file = await fetch(new URL(model.file, import.meta.url));
      model.weights = Float64Array.from(new Float32Array(await file.arrayBuffer()));
    } else {
      model.weights = this.#results(this.wasm.opencv_model(model.which));
    }
    this.make(model.width, model.height, model.weights, model.gamma);
    this.model = model;
  }

  /** Makes the detector of these weights. */
  make(width, height, weights, gamma = 1) {
    this.#write(new Uint8Array(Float32Array.from(weights).buffer));
    this.#results(this.wasm.make(width, height, gamma));
  }

  /** Rectangles with `weight` in `image` = {width, height, channels, data}; `group` below 1 leaves every hit.
   * `stride` and `padding` are a number, or [x, y] [px]. */
  search(image, { threshold = 0, stride = 8, padding = 0, scale = 1.05, group = 2, meanShift = false } = {}) {
    this.#write(image.data);
    const { width, height, channels } = image;
    const [strides, paddings] = [stride, padding].map((side) => [side].flat());
    const places = [strides[0], strides.at(-1), paddings[0], paddings.at(-1)];
    const found = this.#results(
      this.wasm.search(width, height, channels, threshold, ...places, scale, group, meanShift),
    );
    return Array.from({ length: found.length / 5 }, (_, i) => {
      const [x, y, w, h, weight] = found.subarray(5 * i, 5 * i + 5);
      return { x, y, width: w, height: h, weight };
    });
  }

  /** Two votes of each pixel: [share, share, bin, bin] one after the other. */
  gradient(image) {
    this.#write(image.data);
    return this.#results(this.wasm.gradient(image.width, image.height, image.channels));
  }

  /** The descriptor of an image as large as the model's window. */
  describe(image) {
    this.#write(image.data);
    return this.#results(this.wasm.describe(image.width, image.height, image.channels));
  }
}

/** A canvas's pixels without their opacity, as the engine takes them. */
export function pixels(context, x = 0, y = 0, width = context.canvas.width, height = context.canvas.height) {
  const { data } = context.getImageData(x, y, width, height);
  const colours = new Uint8Array(width * height * 3);
  for (let from = 0, to = 0; from < data.length; from += 4, to += 3) {
    colours[to] = data[from];
    colours[to + 1] = data[from + 1];
    colours[to + 2] = data[from + 2];
  }
  return { width, height, channels: 3, data: colours };
}
